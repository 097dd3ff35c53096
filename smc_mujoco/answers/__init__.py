"""What results say: facts, one file of templates, and three layers."""
