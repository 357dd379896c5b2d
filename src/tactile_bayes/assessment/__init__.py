"""Trust in one record: do its intervals hold here, and what do they rest on."""
