"""Rigs, their records, and identification of a rig's quantities from records."""
