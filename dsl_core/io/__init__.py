"""Scans, results, rigs and spectra on disk, and the names of the files by which their folders are known."""

from __future__ import annotations

#: What a scan consists of.
MANIFEST_NAME = "manifest.json"
#: What a campaign of calibrations has done.
CAMPAIGN_NAME = "campaign.json"
#: How folders of a published dataset begin, in small letters without signs, and where its calibration is.
PUBLISHED_STARTS = ("ldrexposure", "blackexposure", "graycodeexposure", "step2")
PUBLISHED_PLACES = ("calibration/calibration_propcam.xml", "dataset/image_formation")
