"""Health: monitors of sensors and stages, one small class each, and what the pipeline does without."""
