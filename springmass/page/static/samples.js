"use strict";
// One sensor's samples as they arrive, in typed arrays that grow by doubling, and a reduction of them to the width of a
// chart.
class Samples {
  constructor() {
    this.count = 0;
    this.t = new Float64Array(4096);
    this.y = new Float64Array(4096);
  }

  // Store the times and values of a message, whose head is four 32-bit integers (1, sensor, first, count).
  take(first, t, y) {
    const stop = first + t.length;
    if (first > this.count) throw new Error(`sample ${this.count} was expected, got ${first}`);
    if (stop > this.t.length) {
      const size = Math.max(stop, 2 * this.t.length);
      for (const name of ["t", "y"]) {
        const grown = new Float64Array(size);
        grown.set(this[name].subarray(0, this.count));
        this[name] = grown;
      }
    }
    this.t.set(t, first);
    this.y.set(y, first);
    this.count = stop;
  }

  // The index of the first sample at or after a time.
  at(time) {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[middle] < time) low = middle + 1; else high = middle;
    }
    return low;
  }

  // Times and values between two times, or the minimum and maximum of each pixel if there are many samples; null marks
  // missing ones.
  between(from, to, pixels) {
    const start = this.at(from), stop = Math.min(this.count, this.at(to) + 1);
    const group = Math.max(1, Math.floor((stop - start) / (2 * pixels)));
    const t = [], y = [];
    if (group < 2) {
      for (let i = start; i < stop; i++) { t.push(this.t[i]); y.push(Number.isNaN(this.y[i]) ? null : this.y[i]); }
      return [t, y];
    }
    for (let i = start; i < stop; i += 2 * group) {
      let least = -1, greatest = -1;
      for (let j = i; j < Math.min(stop, i + 2 * group); j++) {
        if (Number.isNaN(this.y[j])) continue;
        if (least < 0 || this.y[j] < this.y[least]) least = j;
        if (greatest < 0 || this.y[j] > this.y[greatest]) greatest = j;
      }
      if (least < 0) { t.push(this.t[i]); y.push(null); continue; }
      for (const j of least < greatest ? [least, greatest] : [greatest, least]) { t.push(this.t[j]); y.push(this.y[j]); }
    }
    return [t, y];
  }

  // Positions and central differences of the latest swings, without the edges, where a central difference is undefined.
  orbit(from, to, reach) {
    const start = this.at(from), stop = Math.min(this.count, this.at(to));
    const found = [];
    for (let i = start + reach; i < stop - reach; i++) {
      const v = (this.y[i + reach] - this.y[i - reach]) / (this.t[i + reach] - this.t[i - reach]);
      if (Number.isFinite(v) && Number.isFinite(this.y[i])) found.push([this.y[i], v]);
    }
    return found;
  }
}
