"""Shots that show their pattern: what is taken again or doubted, and what to do where pictures stay wrong."""
