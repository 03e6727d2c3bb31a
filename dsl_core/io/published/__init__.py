"""Import and export of the published layout of DSL scans and calibrations.

Names and shapes are facts from the public repository of S. Shin, S. Choi, F. Heide, S.-H. Baek, Dispersed
Structured Light for Hyperspectral 3D Imaging, CVPR 2024 (README, ``ArgParser.py`` and the readers of each
file); the calibration file's names go back to kamino410/procam-calibration, a third dialect is that of
D. Moreno and G. Taubin's calibration software (3DIMPVT 2012). No code of theirs is used.
"""
