"""Reports: one self-contained HTML page of a run, a training, an evaluation or a benchmark."""
