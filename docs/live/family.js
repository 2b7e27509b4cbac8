/** Any depth from one file: docs/onnx_contract.md says what a family is. */

// Numbers of fields in https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
const GRAPH = 7;
const INITIALIZER = 5;
const NAME = 8;
const NUMBER = [4, 9]; // float_data, raw_data

/**
 * A family with a depth in it: the four bytes of its initializer `depth_m` are replaced, and what follows from them any
 * engine calculates while it loads the model.
 *
 * @param {ArrayBuffer} contents of the ONNX file
 * @param {number} depth in metres of its medium, within its range
 * @throws {Error} in words, if the file is no family
 */
export function atDepth(contents, depth) {
    const bytes = new Uint8Array(contents.slice(0));
    const named = new TextEncoder().encode("depth_m").join();
    const places = [];
    for (const graph of fields(bytes)) {
        if (graph.number !== GRAPH) continue;
        for (const tensor of fields(graph.bytes)) {
            if (tensor.number !== INITIALIZER) continue;
            const inside = [...fields(tensor.bytes)];
            if (!inside.some(({ number, bytes }) => number === NAME && bytes.join() === named)) continue;
            places.push(...inside.filter(({ number, bytes }) => NUMBER.includes(number) && bytes.length === 4));
        }
    }
    if (places.length !== 1) throw new Error("The file is no family: there is no depth to be set.");
    const [{ bytes: place }] = places;
    new DataView(place.buffer, place.byteOffset, 4).setFloat32(0, depth, true);
    return bytes;
}

/**
 * The fields of a message of Protocol Buffers that hold bytes.
 *
 * @param {Uint8Array<ArrayBuffer>} message
 * @returns {Generator<{number: number, bytes: Uint8Array<ArrayBuffer>}>}
 */
function* fields(message) {
    let at = 0;
    const varint = () => {
        let number = 0;
        for (let factor = 1; ; factor *= 128) {
            if (at >= message.length) throw new Error("The file is no ONNX file: a number is cut off.");
            const byte = message[at++];
            number += (byte % 128) * factor;
            if (byte < 128) return number;
        }
    };
    while (at < message.length) {
        const tag = varint();
        const type = tag % 8;
        if (type === 0) {
            varint();
            continue;
        }
        const size = type === 1 ? 8 : type === 2 ? varint() : type === 5 ? 4 : Infinity;
        if (size > message.length - at) throw new Error("The file is no ONNX file: a field is cut off.");
        yield { number: Math.floor(tag / 8), bytes: message.subarray(at, at + size) };
        at += size;
    }
}
