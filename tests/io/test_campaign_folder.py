"""A campaign's files: what is proposed, accepted, discarded and remembered."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.campaign_folder import CampaignFolder, CampaignInfo, take_campaign
from dsl_core.io.records import read_record
from dsl_core.model.calibration.accepted import AcceptedCalibration


@pytest.fixture
def campaign(tmp_path: Path) -> CampaignFolder:
    return CampaignFolder.begin(tmp_path / "campaign", "twin", {"size": "32x24"}, {"geometry": {"step": "5"}})


def fit(title: str, name: str = "geometry") -> AcceptedCalibration:
    return AcceptedCalibration(name=name, title=title, record={"value": 1.5})


def test_a_fit_is_a_candidate_until_it_is_accepted(campaign: CampaignFolder) -> None:
    campaign.propose(fit("first"))
    assert campaign.candidate("geometry") == fit("first")
    assert campaign.accepted("geometry") is None
    accepted = campaign.accept("geometry")
    assert accepted.accepted
    assert accepted.model_copy(update={"accepted": ""}) == fit("first")
    again = CampaignFolder.open(campaign.path)
    assert again.accepted("geometry") == accepted
    assert again.candidate("geometry") is None
    with pytest.raises(StoreError, match="no fit of geometry"):
        again.accept("geometry")


def test_a_discarded_fit_is_gone_and_the_accepted_one_stays(campaign: CampaignFolder) -> None:
    campaign.propose(fit("first"))
    accepted = campaign.accept("geometry")
    campaign.propose(fit("second"))
    campaign.propose(fit("other", "film"))
    campaign.discard("geometry")
    campaign.discard("geometry")
    assert campaign.candidate("geometry") is None
    assert campaign.candidate("film") == fit("other", "film")
    assert campaign.accepted("geometry") == accepted


def test_a_candidate_that_the_drive_keeps_is_told(
    campaign: CampaignFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: object, **named: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, "unlink", refuse)
    with pytest.raises(StoreError, match=r"geometry.json could not be written \(Read-only"):
        campaign.discard("geometry")


def test_what_is_replaced_goes_into_the_history_oldest_first(campaign: CampaignFolder) -> None:
    for title in ("first", "second", "third"):
        campaign.propose(fit(title))
        campaign.accept("geometry")
    assert [old.title for old in campaign.history("geometry")] == ["first", "second"]
    accepted = campaign.accepted("geometry")
    assert accepted is not None
    assert accepted.title == "third"
    assert campaign.history("film") == ()


def test_settings_add_up_and_are_replaced_one_calibration_at_a_time(campaign: CampaignFolder) -> None:
    same = CampaignFolder.begin(campaign.path, None, {}, {"geometry": {"poses": "9"}, "film": {"step": "7"}})
    assert same.info.settings == {"geometry": {"step": "5", "poses": "9"}, "film": {"step": "7"}}
    changed = same.with_settings("geometry", {"poses": "3"})
    assert changed.info.settings == {"geometry": {"poses": "3"}, "film": {"step": "7"}}
    assert CampaignFolder.open(campaign.path).info == same.info, "nothing is written before it is saved"
    changed.with_settings("film", {}).save()
    assert CampaignFolder.open(campaign.path).info.settings == {"geometry": {"poses": "3"}}


def test_a_campaign_keeps_to_its_rig_and_to_a_folder_of_its_own(
    campaign: CampaignFolder, tmp_path: Path
) -> None:
    assert CampaignFolder.prepare(campaign.path, "twin", {"size": "32x24"}).info == campaign.info
    for rig, options in (("replay", {}), ("twin", {"size": "64x48"})):
        with pytest.raises(StoreError, match="was begun with the rig twin size=32x24"):
            CampaignFolder.prepare(campaign.path, rig, options)
    with pytest.raises(StoreError, match="is not a campaign"):
        CampaignFolder.open(tmp_path)
    (tmp_path / "letter.txt").write_text("Dear", encoding="utf-8")
    with pytest.raises(StoreError, match="neither empty nor a campaign"):
        CampaignFolder.prepare(tmp_path, "twin", {})


def test_a_campaign_that_was_killed_while_it_began_may_begin_again(tmp_path: Path) -> None:
    (tmp_path / "lock").touch()
    (tmp_path / "campaign.json.part").touch()
    assert CampaignFolder.begin(tmp_path, None, {}).info.rig == "twin"


def test_a_campaign_whose_first_file_is_damaged_can_be_continued_as_it_advises(
    campaign: CampaignFolder,
) -> None:
    campaign.propose(fit("first"))
    accepted = campaign.accept("geometry")
    step = campaign.home("geometry") / "pose-01"
    step.mkdir(parents=True)
    (step / "capture.json").write_text("{}")
    path = campaign.path / "campaign.json"
    path.write_text(path.read_text()[:60])
    with pytest.raises(StoreError, match=r"cut off.* delete it and begin the campaign in this folder again"):
        CampaignFolder.open(campaign.path)
    path.unlink()
    with pytest.raises(StoreError, match=r"Begin a campaign of this name with its rig and options"):
        CampaignFolder.open(campaign.path)
    with pytest.raises(StoreError, match=r"holds the captures of a campaign.*--rig"):
        CampaignFolder.begin(campaign.path, None, {})
    again = CampaignFolder.begin(campaign.path, "twin", {"size": "32x24"})
    assert again.accepted("geometry") == accepted


def test_a_damaged_file_names_its_first_wrong_field(campaign: CampaignFolder) -> None:
    path = campaign.path / "geometry.json"
    path.write_text('{"name": "geometry"}', encoding="utf-8")
    with pytest.raises(StoreError, match="title"):
        campaign.accepted("geometry")
    with pytest.raises(StoreError, match="cannot be read"):
        read_record(campaign.path, CampaignInfo)


def test_a_fit_in_a_folder_that_is_gone_is_not_said_to_be_missing(campaign: CampaignFolder) -> None:
    campaign.path.rename(campaign.path.with_name("moved"))
    with pytest.raises(StoreError, match="there is no such folder"):
        campaign.accept("geometry")


def test_whoever_takes_a_campaign_clears_what_a_killed_writer_left(tmp_path: Path) -> None:
    step = tmp_path / "geometry" / "pose-1"
    step.mkdir(parents=True)
    (step / "capture.json").write_text("{}")
    (step / "capture.json.partial").write_text("{")
    lock = take_campaign(tmp_path)
    assert sorted(each.name for each in step.iterdir()) == ["capture.json"]
    with pytest.raises(StoreError, match="is being written by another process"):
        take_campaign(tmp_path)
    lock.release()
    take_campaign(tmp_path).release()
