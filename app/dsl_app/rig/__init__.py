"""The Rig page: connection, live view and projector."""
