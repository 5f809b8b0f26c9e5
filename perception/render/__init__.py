"""Pictures, videos and plots of what the stages found."""
