// Arrays and pictures that the page holds as base64 text: typed arrays, little-endian as in all browsers of today.

const TYPES = { float32: Float32Array, uint32: Uint32Array, uint8: Uint8Array };

function bytes(text) {
  const letters = atob(text);
  const result = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) result[i] = letters.charCodeAt(i);
  return result;
}

export class Buffers {
  constructor(texts) {
    this.texts = texts;
    this.arrays = new Map();
  }

  /** The array that {type, data} names, or null for null; decoded once. */
  array(told) {
    if (!told) return null;
    const name = `${told.type} ${told.data}`;
    if (!this.arrays.has(name)) this.arrays.set(name, new TYPES[told.type](bytes(this.texts[told.data]).buffer));
    return this.arrays.get(name);
  }

  /** The address of a JPEG. */
  picture(name) {
    return `data:image/jpeg;base64,${this.texts[name]}`;
  }
}
