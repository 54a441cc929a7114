"""What is measured and what is found: bags, records, result documents, and how quantities are shown."""
