"""What makes a mechanism real: friction, contact, drives, backlash, encoder."""
