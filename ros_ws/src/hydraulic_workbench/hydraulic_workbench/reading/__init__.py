"""What the process beside the server does: plain functions from paths to documents for the page (see `workers`)."""
