"""Folders of pictures that other programs captured: what each picture is, and how it becomes a frame."""
