"""Planes and averages over tiles, which every calibration may use."""
