"""The line with which a command ends: what was found in the user's quantities, and what to do."""
