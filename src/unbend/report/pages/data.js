// What _shown.py packed, unpacked into typed arrays.
"use strict";

async function unpack({ data, columns, low, step }) {
  const bytes = Uint8Array.from(atob(data), (character) => character.charCodeAt(0));
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(inflated).arrayBuffer());
  const n = planes.length / 4, rows = n / columns, numbers = new Int32Array(n);
  for (let i = 0; i < n; i++) {
    let folded = 0;
    for (let plane = 3; plane >= 0; plane--) folded = folded * 256 + planes[plane * n + i];
    const row = i % rows, to = row * columns + Math.floor(i / rows);
    numbers[to] = (row && numbers[to - columns]) + (folded % 2 ? -(folded + 1) / 2 : folded / 2);
  }
  return low ? Float64Array.from(numbers, (value, i) => low[i % columns] + step * value) : numbers;
}

// Every packed array within a value, at any depth.
async function unpackAll(value) {
  if (value === null || typeof value !== "object") return value;
  if (typeof value.data === "string" && value.columns) return unpack(value);
  if (Array.isArray(value)) return Promise.all(value.map(unpackAll));
  const entries = Object.entries(value).map(async ([key, one]) => [key, await unpackAll(one)]);
  return Object.fromEntries(await Promise.all(entries));
}
