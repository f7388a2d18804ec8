"""Text that holds numbers: where its words are, what they say, and others in their place; for every text format."""
