"""Scans and results in an object store: equal after a round trip, whole or not there, secrets never told."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("obstore", reason="the extra s3 is not installed")

from dsl_core.errors import StoreError, TakenError
from dsl_core.io.claims import ClaimedError
from dsl_core.io.objects import rooms, store
from dsl_core.io.objects.address import Address, address_of, shown
from dsl_core.io.objects.claim import ObjectClaim
from dsl_core.io.objects.copies import fetch, publish, published_as
from dsl_core.io.objects.rooms import brought, published
from dsl_core.io.objects.store import ObjectFolder
from dsl_core.io.result.result_file import load_result, save_result
from tests.cases.object_store import KEY, SECRET, ObjectStoreTwin, running
from tests.cases.small_result import small_result

RESULT = Address("bucket", "2026/a.zarr")


@pytest.fixture
def twin(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[ObjectStoreTwin]:
    """An empty store, in the environment; rooms for it are in a folder of the test."""
    monkeypatch.setattr(rooms, "own_folder", lambda kind: tmp_path / "cache")
    monkeypatch.setattr(store, "_RETRY", {"max_retries": 0})
    with running() as twin:
        for name, value in twin.environment().items():
            monkeypatch.setenv(name, value)
        yield twin


@pytest.fixture
def result(tmp_path: Path) -> Path:
    return save_result(small_result(), tmp_path / "a.zarr")


def test_an_address_keeps_bucket_and_name_and_refuses_secrets() -> None:
    assert address_of(Path("s3://bucket/2026/a.zarr")) == RESULT
    assert shown(Path("s3://bucket/2026/a.zarr")) == "s3://bucket/2026/a.zarr"
    assert address_of(Path("a.zarr")) is None
    with pytest.raises(StoreError, match="names no object"):
        address_of(Path("s3://bucket"))
    with pytest.raises(StoreError, match="must not contain a user") as told:
        address_of(Path(f"s3://{KEY}:{SECRET}@bucket/a"))
    assert SECRET not in str(told.value)


def test_a_result_is_the_same_after_a_round_trip(twin: ObjectStoreTwin, result: Path) -> None:
    with published(Path("s3://bucket/2026/a.zarr")) as draft:
        save_result(small_result(), draft)
    assert published_as(ObjectFolder(RESULT), "schema_version") is not None
    with brought(Path("s3://bucket/2026/a.zarr")) as folder:
        back = load_result(folder, lazy=False)
    for name, values in load_result(result).items():
        np.testing.assert_array_equal(back[name].values, values.values)
    assert not list(rooms.room_of(RESULT).parent.glob("*"))


def test_empty_objects_in_place_of_folders_are_no_files(
    twin: ObjectStoreTwin, result: Path, tmp_path: Path
) -> None:
    """Consoles and mounted stores make them; a name that only such an object has is free."""
    twin.put("2026/a.zarr/", b"")
    publish(result, ObjectFolder(RESULT))
    for folder in ("", "rgb/", "rgb/c/"):
        twin.put(f"2026/a.zarr/{folder}", b"")
    fetch(ObjectFolder(RESULT), tmp_path / "copy")
    back = load_result(tmp_path / "copy", lazy=False)
    np.testing.assert_array_equal(back["rgb"].values, load_result(result)["rgb"].values)


def test_what_is_here_is_not_brought_again(twin: ObjectStoreTwin, result: Path, tmp_path: Path) -> None:
    publish(result, ObjectFolder(RESULT))
    for _ in range(2):
        fetch(ObjectFolder(RESULT), tmp_path / "copy")
    got = [name for method, name in twin.requests if method == "GET" and name.endswith("rgb/zarr.json")]
    assert len(got) == 1
    twin.put("2026/a.zarr/rgb/zarr.json", b"x")
    fetch(ObjectFolder(RESULT), tmp_path / "copy")
    assert (tmp_path / "copy" / "rgb" / "zarr.json").read_bytes() == b"x"


def test_a_store_that_vanishes_midway_leaves_no_result_and_the_next_try_completes_it(
    twin: ObjectStoreTwin, result: Path
) -> None:
    puts = []

    def vanishes(method: str, name: str) -> int | None:
        puts.extend([name] if method == "PUT" and name.startswith("2026/a.zarr/") else [])
        return 503 if len(puts) > 5 else None

    twin.refuse = vanishes
    with (
        pytest.raises(StoreError, match="does not answer"),
        published(Path("s3://bucket/2026/a.zarr")) as draft,
    ):
        save_result(small_result(), draft)
    twin.refuse = lambda method, name: None
    assert published_as(ObjectFolder(RESULT), "schema_version") is None
    with published(Path("s3://bucket/2026/a.zarr")) as draft:
        assert draft.is_dir()  # what was computed is not lost
    assert published_as(ObjectFolder(RESULT), "schema_version") is not None


def test_only_results_are_replaced_and_only_where_that_is_allowed(
    twin: ObjectStoreTwin, result: Path
) -> None:
    objects = ObjectFolder(RESULT)
    publish(result, objects)
    with pytest.raises(TakenError, match=r"s3://bucket/2026/a\.zarr already exists"):
        publish(result, objects)
    twin.put("2026/a.zarr/old/c/0/0", b"of an earlier result")
    publish(result, objects, overwrite=True)
    assert "2026/a.zarr/old/c/0/0" not in twin.objects
    twin.put("2026/a.zarr/notes.txt", b"mine")
    with pytest.raises(StoreError, match=r"contains notes\.txt"):
        publish(result, objects, overwrite=True)
    assert "2026/a.zarr/zarr.json" in twin.objects


def test_a_name_that_is_taken_is_told_before_work_begins(twin: ObjectStoreTwin, result: Path) -> None:
    publish(result, ObjectFolder(RESULT))
    began = list[Path]()
    with pytest.raises(TakenError), published(Path("s3://bucket/2026/a.zarr")) as draft:
        began.append(draft)
    assert not began
    with published(Path("s3://bucket/2026/a.zarr"), overwrite=True) as draft:
        save_result(small_result(), draft)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("notes.txt", b"mine", r"contains notes\.txt"),
        (
            "zarr.json",
            b'{"zarr_format": 3, "attributes": {"title": "rain"}}',
            "arrays that this program did not write",
        ),
        ("zarr.json", b"{", "arrays that this program did not write"),
    ],
)
@pytest.mark.parametrize("overwrite", [False, True])
def test_what_others_have_at_an_address_is_told_before_work_begins_and_stays(
    twin: ObjectStoreTwin, result: Path, name: str, content: bytes, told: str, overwrite: bool
) -> None:
    twin.put(f"2026/a.zarr/{name}", content)
    twin.put("2026/a.zarr/rain/c/0", b"years of it")
    began = list[Path]()
    with (
        pytest.raises(StoreError, match=told),
        published(Path("s3://bucket/2026/a.zarr"), overwrite=overwrite) as draft,
    ):
        began.append(draft)
    assert not began
    with pytest.raises(StoreError, match=told):
        publish(result, ObjectFolder(RESULT), overwrite=overwrite)
    assert twin.objects.keys() == {f"2026/a.zarr/{name}", "2026/a.zarr/rain/c/0"}


def test_a_result_that_lacks_a_file_is_none(twin: ObjectStoreTwin, result: Path) -> None:
    publish(result, ObjectFolder(RESULT))
    del twin.objects["2026/a.zarr/rgb/zarr.json"]
    assert published_as(ObjectFolder(RESULT), "schema_version") is None


def test_an_object_never_leads_out_of_the_folder(twin: ObjectStoreTwin, tmp_path: Path) -> None:
    twin.put("2026/a.zarr/a:b", b"")
    with pytest.raises(StoreError, match="would be outside"):
        fetch(ObjectFolder(RESULT), tmp_path / "copy")


@pytest.mark.parametrize(
    ("status", "words"),
    [(403, "refused the credentials"), (401, "refused the credentials"), (500, "does not answer")],
)
def test_refusals_are_told_without_secrets(
    twin: ObjectStoreTwin, status: int, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    twin.refuse = lambda method, name: status
    objects = ObjectFolder(RESULT)
    for call in (objects.listed, lambda: objects.get("a"), lambda: objects.put("a", b"")):
        with pytest.raises(StoreError, match=words) as told:
            call()
        assert told.value.__suppress_context__
        assert KEY not in str(told.value) + caplog.text
        assert SECRET not in str(told.value) + repr(vars(objects)) + caplog.text


def test_a_bucket_that_is_not_there_is_named(twin: ObjectStoreTwin) -> None:
    twin.refuse = lambda method, name: 404
    with pytest.raises(StoreError, match="the bucket bucket is not there"):
        ObjectFolder(RESULT).listed()


def test_a_large_object_is_written_in_parts(twin: ObjectStoreTwin) -> None:
    content = np.random.default_rng(1).bytes(12 << 20)
    ObjectFolder(RESULT).put("large", content)
    assert ObjectFolder(RESULT).get("large") == content
    assert sum(method == "PUT" for method, _ in twin.requests) > 1


def test_nothing_at_an_address_is_told(twin: ObjectStoreTwin, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"There is nothing at s3://bucket/2026/a\.zarr"):
        fetch(ObjectFolder(RESULT), tmp_path / "copy")


def test_a_claim_in_a_store_holds_and_lapses(twin: ObjectStoreTwin) -> None:
    claim = ObjectClaim(RESULT)
    with pytest.raises(ClaimedError, match=r"s3://bucket/2026/a\.zarr is being made by process"):
        ObjectClaim(RESULT)
    twin.age("2026/.claims/a.zarr.claim", 1000)
    with ObjectClaim(RESULT) as mine:
        assert "which died; it is made again" in mine.taken_over
        claim.release()  # its computer slept, and is awake again
        with pytest.raises(ClaimedError):
            ObjectClaim(RESULT)
    assert not [name for name in twin.objects if ".claims" in name]


def test_an_owner_that_slept_does_not_take_its_claim_back(twin: ObjectStoreTwin) -> None:
    slept, name = ObjectClaim(RESULT), "2026/.claims/a.zarr.claim"
    twin.age(name, 1000)
    with ObjectClaim(RESULT):
        mine = twin.objects[name]
        slept._beat(0.01)  # it ends when it finds that the claim is another's
        assert twin.objects[name] == mine
    slept.release()


def test_one_of_two_takes_over_what_a_dead_owner_claimed(
    twin: ObjectStoreTwin, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed, quicker = ObjectFolder.listed, list[ObjectClaim]()

    def slowly(self: ObjectFolder) -> dict[str, store.Found]:
        found = listed(self)
        if not quicker:
            monkeypatch.setattr(ObjectFolder, "listed", listed)
            quicker.append(ObjectClaim(RESULT))
        return found

    dead = ObjectClaim(RESULT)
    twin.age("2026/.claims/a.zarr.claim", 1000)
    monkeypatch.setattr(ObjectFolder, "listed", slowly)
    with pytest.raises(ClaimedError):
        ObjectClaim(RESULT)
    assert quicker[0]._is_mine()
    quicker[0].release()
    dead.release()


def test_several_may_ask_at_once_who_has_a_claim(
    twin: ObjectStoreTwin, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed, asked = ObjectFolder.listed, list[str]()

    def meanwhile(self: ObjectFolder) -> dict[str, store.Found]:
        if not asked:
            asked.append("by another")
            with pytest.raises(ClaimedError):
                ObjectClaim(RESULT)
        return listed(self)

    with ObjectClaim(RESULT):
        monkeypatch.setattr(ObjectFolder, "listed", meanwhile)
        with pytest.raises(ClaimedError, match="is being made by process"):
            ObjectClaim(RESULT)
    assert not [name for name in twin.objects if ".claims" in name]


def test_an_owner_renews_its_claim(twin: ObjectStoreTwin) -> None:
    with ObjectClaim(RESULT, beat_s=0.01) as claim:
        for _ in range(500):
            claim._ended.wait(0.01)
            if len([1 for method, name in twin.requests if method == "PUT"]) > 2:
                break
        assert len([1 for method, name in twin.requests if method == "PUT"]) > 2
