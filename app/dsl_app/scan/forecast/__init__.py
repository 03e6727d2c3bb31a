"""Accuracy against time, predicted and measured."""
