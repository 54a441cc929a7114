"""Linear models: frequency responses, identification, validation, and estimation while the bench runs."""
