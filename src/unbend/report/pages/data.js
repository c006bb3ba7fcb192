// What _shown.py packed, unpacked into typed arrays.
"use strict";

async function unpack(packed) {
  const text = atob(packed.data);
  const bytes = Uint8Array.from(text, (character) => character.charCodeAt(0));
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(inflated).arrayBuffer());
  const { columns, planes: width } = packed;
  const rows = planes.length / (columns * width);
  const numbers = new Int32Array(rows * columns);
  for (let column = 0; column < columns; column++) {
    const start = column * width * rows;
    let value = 0;
    for (let row = 0; row < rows; row++) {
      let folded = 0;
      for (let plane = width - 1; plane >= 0; plane--) {
        folded = folded * 256 + planes[start + plane * rows + row];
      }
      value += folded % 2 ? -(folded + 1) / 2 : folded / 2;
      numbers[row * columns + column] = value;
    }
  }
  if (packed.step === undefined) return numbers;
  const { low, step } = packed;
  return Float64Array.from(numbers, (value, i) => low[i % columns] + step * value);
}

// Every packed array within a value, at any depth.
async function unpackAll(value) {
  if (value === null || typeof value !== "object") return value;
  if (typeof value.data === "string" && value.planes) return unpack(value);
  if (Array.isArray(value)) return Promise.all(value.map(unpackAll));
  const entries = Object.entries(value).map(async ([key, one]) => [key, await unpackAll(one)]);
  return Object.fromEntries(await Promise.all(entries));
}
