"""Single contacts: from a contact to the base wrench, and back, compiled."""
