"""Rig profiles: made and edited by choosing from the devices that were found."""
