"""The samples of the live view: every sample of the plant once, columns of one instant in one row."""

from __future__ import annotations

import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_workbench.frames import samples_frame
from hydraulic_workbench.sample_ring import SampleRing

MS = 1_000_000
STATE, OTHER = (0, 1), (2,)


def stamps(*milliseconds: int) -> np.ndarray:
    return np.array(milliseconds, np.int64) * MS


def rows(value: float, count: int, columns: int = 2) -> np.ndarray:
    return np.full((columns, count), value, np.float32)


@pytest.fixture
def ring() -> SampleRing:
    return SampleRing(100, 3, 200 * MS)


def test_other_topics_join_the_row_of_their_stamp(ring: SampleRing) -> None:
    ring.append(STATE, stamps(1, 2, 3), rows(1.0, 3))
    ring.fill(OTHER, stamps(2), rows(7.0, 1, 1))
    found = ring.rows(0, 3)
    assert found.time.tolist() == pytest.approx([0.0, 0.001, 0.002])
    assert np.isnan(found.values[2, [0, 2]]).all() and found.values[2, 1] == 7.0


def test_what_comes_before_its_state_waits_for_it(ring: SampleRing) -> None:
    ring.append(STATE, stamps(1), rows(1.0, 1))
    ring.fill(OTHER, stamps(2, 3), rows(5.0, 2, 1))
    ring.append(STATE, stamps(2, 3), rows(1.0, 2))
    assert ring.rows(1, 3).values[2].tolist() == [5.0, 5.0]


def test_a_row_is_complete_when_the_awaited_topics_have_come_or_have_had_their_time(ring: SampleRing) -> None:
    ring.append(STATE, stamps(1, 2, 3), rows(1.0, 3))
    ring.fill(OTHER, stamps(1, 2), rows(5.0, 2, 1))
    assert ring.complete([2]) == 2
    assert ring.complete([]) == 3
    ring.append(STATE, stamps(400), rows(1.0, 1))
    assert ring.complete([2]) == 3, "the third has waited for more than 200 ms"


def test_stamps_that_go_back_begin_a_new_epoch(ring: SampleRing) -> None:
    ring.append(STATE, stamps(10, 11), rows(1.0, 2))
    before = ring.epoch
    ring.append(STATE, stamps(5, 6, 7), rows(2.0, 3))
    assert ring.epoch == before + 1
    found = ring.rows(0, 10)
    assert found.values[0].tolist() == [2.0] * 3 and found.time[0] == 0.0


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(1, 70), min_size=1, max_size=40), st.integers(20, 60))
def test_a_reader_gets_every_sample_once_and_in_order(batches: list[int], capacity: int) -> None:
    ring, cursor, seen, number = SampleRing(capacity, 3, 0), 0, [], 0
    for size in batches:
        size = min(size, capacity)
        own = np.arange(number + 1, number + size + 1, dtype=np.int64) * MS
        ring.append(STATE, own, np.tile(np.arange(number, number + size, dtype=np.float32), (2, 1)))
        number += size
        found = ring.rows(cursor, ring.complete([]))
        cursor = found.first + found.time.size
        seen += found.values[0].tolist()
    assert seen == list(range(number))


def test_what_is_no_longer_kept_is_passed_over(ring: SampleRing) -> None:
    for start in range(0, 1000, 50):
        ring.append(STATE, np.arange(start + 1, start + 51, dtype=np.int64) * MS, rows(float(start), 50))
    found = ring.rows(0, 1000)
    assert 1000 - found.first == found.time.size >= 100


def test_seconds_ago(ring: SampleRing) -> None:
    ring.append(STATE, np.arange(1, 101, dtype=np.int64) * MS, rows(0.0, 100))
    assert ring.number_at(0.010, 100) == 89


def test_a_frame_has_the_layout_that_the_page_reads(ring: SampleRing) -> None:
    ring.append(STATE, stamps(1, 3), np.array([[1.0, 2.0], [3.0, 4.0]], np.float32))
    frame = samples_frame(4, 9, ring.rows(0, 2))
    assert struct.unpack_from("<BBHIII", frame) == (1, 0, 3, 2, 4, 9)
    assert np.frombuffer(frame, "<f8", 2, 16).tolist() == pytest.approx([0.0, 0.002])
    assert np.frombuffer(frame, "<f4", 2, 16 + 16 + 4 * 2 * 1).tolist() == [3.0, 4.0]
    assert len(frame) == 16 + 2 * 8 + 3 * 2 * 4


def test_the_kept_half_moves_without_a_copy_of_all() -> None:
    """The heap of a process keeps the room of a large copy: its memory would grow after some minutes."""
    capacity, columns = 20_000, 17
    ring = SampleRing(capacity, columns, 200 * MS)
    times = np.arange(1, 2 * capacity + 1, dtype=np.int64) * MS
    for part in (times[:capacity], times[capacity:]):
        ring.append(range(columns), part, np.tile(part.astype(np.float32), (columns, 1)))
    tracemalloc.start()
    try:
        after = times[-1:] + MS
        ring.append(range(columns), after, np.ones((columns, 1), np.float32))
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert ring.newest_ns == after[0]
    assert most < 0.5 * 4 * columns * capacity
