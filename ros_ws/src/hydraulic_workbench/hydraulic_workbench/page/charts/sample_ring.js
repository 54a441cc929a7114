// The last samples of all live channels, in order and contiguous, so that a view of them costs no copy.

export class SampleRing {
  /** Keeps at least `capacity` samples of each of the named channels. */
  constructor(names, capacity) {
    this.names = names;
    this.capacity = capacity;
    this.time = new Float64Array(2 * capacity);
    this.values = new Map(names.map((name) => [name, new Float32Array(2 * capacity)]));
    this.clear();
  }

  /** Forget everything: another plant, another time. */
  clear() {
    this.end = 0; // place of the next sample
    this.start = 0; // place of the oldest one
    this.moved = 0; // samples that were dropped in front: the number of a sample stays what it was
  }

  get length() {
    return this.end - this.start;
  }

  get newest() {
    return this.length ? this.time[this.end - 1] : NaN;
  }

  get oldest() {
    return this.length ? this.time[this.start] : NaN;
  }

  /** Append `count` samples: their times, and one array per channel (channels left out become NaN). */
  append(times, columns, count) {
    if (this.end + count > this.time.length) this.compact(count);
    this.time.set(times.subarray(0, count), this.end);
    for (const [name, target] of this.values) {
      const column = columns.get(name);
      if (column) target.set(column.subarray(0, count), this.end);
      else target.fill(NaN, this.end, this.end + count);
    }
    this.end += count;
    this.start = Math.max(this.start, this.end - this.capacity);
  }

  compact(room) {
    const from = Math.max(this.start, this.end + room - this.time.length, this.end - this.capacity + room);
    this.time.copyWithin(0, from, this.end);
    for (const target of this.values.values()) target.copyWithin(0, from, this.end);
    this.moved += from;
    this.end -= from;
    this.start = Math.max(0, this.start - from);
  }

  /** Place of the first sample at or after a time. */
  place(time) {
    let low = this.start;
    let high = this.end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** A copy that stands still while this one goes on. */
  frozen() {
    const copy = new SampleRing([], 0);
    copy.names = this.names;
    copy.capacity = this.length;
    copy.time = this.time.slice(this.start, this.end);
    copy.values = new Map([...this.values].map(([name, all]) => [name, all.slice(this.start, this.end)]));
    copy.end = this.length;
    copy.moved = this.moved + this.start;
    return copy;
  }

  /** Last value of a channel, NaN if there is none. */
  last(name) {
    const all = this.values.get(name);
    return all && this.length ? all[this.end - 1] : NaN;
  }

  /** Whether a channel has any value; a look at a few hundred samples tells. */
  has(name) {
    const all = this.values.get(name);
    const step = Math.max(1, Math.floor(this.length / 500));
    for (let k = this.end - 1; k >= this.start; k -= step) if (all[k] === all[k]) return true;
    return false;
  }

  /** Value of a channel at the sample nearest to a time. */
  at(name, time) {
    const all = this.values.get(name);
    if (!all || !this.length) return NaN;
    let place = Math.min(this.place(time), this.end - 1);
    if (place > this.start && time - this.time[place - 1] < this.time[place] - time) place -= 1;
    return all[place];
  }

  /**
   * What a plot `pixels` wide needs to show of some channels between two times: [time, channel, channel, …].
   * Every sample while they fit; else the extremes of intervals that do not move with the view, in their order.
   */
  view(names, from, to, pixels) {
    const first = Math.max(this.start, this.place(from) - 1);
    const last = Math.min(this.end, this.place(to) + 1);
    const columns = names.map((name) => this.values.get(name));
    const step = Math.ceil((last - first) / Math.max(1, pixels));
    if (step <= 4) {
      return [this.time.subarray(first, last), ...columns.map((all) => (all ? all.subarray(first, last) : []))];
    }
    return extremes(this.time, columns, first, last, step, this.moved);
  }
}

function extremes(time, columns, first, last, step, moved) {
  const begin = first - ((first + moved) % step); // of an interval that is the same in the next picture
  const count = Math.ceil((last - begin) / step);
  const times = new Float64Array(2 * count);
  const result = columns.map(() => new Float32Array(2 * count));
  for (let i = 0; i < count; i++) {
    const from = Math.max(first, begin + i * step);
    const to = Math.min(last, begin + (i + 1) * step);
    times[2 * i] = time[from];
    times[2 * i + 1] = time[Math.min(last - 1, (from + to) >> 1)];
    for (let c = 0; c < columns.length; c++) extremesOf(columns[c], from, to, result[c], 2 * i);
  }
  return [times, ...result];
}

function extremesOf(all, from, to, result, place) {
  if (!all) {
    result[place] = result[place + 1] = NaN;
    return;
  }
  let low = Infinity;
  let high = -Infinity;
  let lowAt = from;
  let highAt = from;
  for (let k = from; k < to; k++) {
    const value = all[k];
    if (value < low) [low, lowAt] = [value, k];
    if (value > high) [high, highAt] = [value, k];
  }
  if (low > high) low = high = NaN;
  result[place] = lowAt <= highAt ? low : high;
  result[place + 1] = lowAt <= highAt ? high : low;
}
