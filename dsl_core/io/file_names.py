"""Names of the files by which folders are known; nothing else is imported with them."""

from __future__ import annotations

#: What a scan consists of.
MANIFEST_NAME = "manifest.json"
#: What a campaign of calibrations has done.
CAMPAIGN_NAME = "campaign.json"
#: How folders of a published dataset begin, in small letters without signs, and where its calibration lies.
PUBLISHED_STARTS = ("ldrexposure", "blackexposure", "graycodeexposure", "step2")
PUBLISHED_PLACES = ("calibration/calibration_propcam.xml", "dataset/image_formation")
