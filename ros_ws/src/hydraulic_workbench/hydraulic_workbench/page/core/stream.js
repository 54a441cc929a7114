// Live samples: binary frames become the ring that plots are drawn from.
import { SampleRing } from "../charts/sample_ring.js";

const KEPT = 120000; // samples of each channel: two minutes at 1 kHz

export const live = {
  epoch: null,
  base: 0, // plant time of 0 on the axis [s]
  columns: [],
  ring: new SampleRing([], 1),
  frames: 0,
  samples: 0,
  gaps: 0,
  redraws: 0,
  sequence: -1,
};

const starts = new Set();

/** Call `listener` when another epoch begins, that is, with other channels or another time. */
export function onEpoch(listener) {
  starts.add(listener);
  return () => starts.delete(listener);
}

/** Another epoch: what was kept belongs to another time. */
export function begin(event) {
  live.epoch = event.epoch;
  live.base = event.base;
  live.columns = event.columns;
  live.ring = new SampleRing(event.columns.map((column) => column.key), KEPT);
  for (const listener of starts) listener();
}

/** The connection is new: its frames are counted from 0. */
export function connected() {
  live.sequence = -1;
}

/** Take a frame over; those of another epoch are left alone. */
export function take(buffer) {
  const head = new DataView(buffer);
  if (head.getUint8(0) !== 1) return;
  const sequence = head.getUint32(12, true);
  if (live.sequence >= 0 && sequence !== live.sequence + 1) live.gaps += 1;
  live.sequence = sequence;
  if (head.getUint32(8, true) !== live.epoch) return;
  const columns = head.getUint16(2, true);
  const rows = head.getUint32(4, true);
  const times = new Float64Array(buffer, 16, rows);
  const values = new Map();
  for (let k = 0; k < Math.min(columns, live.columns.length); k++) {
    values.set(live.columns[k].key, new Float32Array(buffer, 16 + 8 * rows + 4 * rows * k, rows));
  }
  const most = live.ring.capacity;
  let first = 0; // what is sent again after a pause is there already
  while (first < rows && times[first] <= live.ring.newest) first += 1;
  for (let from = first; from < rows; from += most) {
    const to = Math.min(rows, from + most);
    const part = new Map([...values].map(([key, all]) => [key, all.subarray(from, to)]));
    live.ring.append(times.subarray(from, to), part, to - from);
  }
  live.frames += 1;
  live.samples += rows - first;
}

/** Description of a live channel. */
export const column = (key) => live.columns.find((one) => one.key === key);
