"""Names of the files by which folders are known; nothing else is imported with them."""

from __future__ import annotations

#: What a scan consists of.
MANIFEST_NAME = "manifest.json"
#: What a campaign of calibrations has done.
CAMPAIGN_NAME = "campaign.json"
