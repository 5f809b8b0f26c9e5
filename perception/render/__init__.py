"""Images, videos and plots of results."""
