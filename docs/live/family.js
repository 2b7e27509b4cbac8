/** Any depth from one file: docs/onnx_contract.md says what a family is. */

// Numbers of fields in https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
const GRAPH = 7;
const INITIALIZER = 5;
const NAME = 8;
const FLOAT_DATA = 4;
const INT32_DATA = 5;
const RAW_DATA = 9;

/** The surface that sees muons from all sides alike. */
export const SPHERE = 1;

/**
 * A family with a depth in it: the four bytes of its initializer `depth_m` are replaced, and what follows from them any
 * engine calculates while it loads the model.
 *
 * @param {ArrayBuffer} contents of the ONNX file
 * @param {number} depth in metres of its medium, within its range
 * @param {number} [surface] what its muons cross: a horizontal plane, or `SPHERE`
 * @throws {Error} in words, if the file is no family, or one without that surface
 */
export function atDepth(contents, depth, surface = 0) {
    const bytes = new Uint8Array(contents.slice(0));
    const place = placeOf(bytes, "depth_m", FLOAT_DATA);
    if (place?.length !== 4) throw new Error("The file is no family: there is no depth to be set.");
    new DataView(place.buffer, place.byteOffset, 4).setFloat32(0, depth, true);
    if (surface !== 0) {
        const byte = placeOf(bytes, "surface", INT32_DATA); // the lowest of four, or a packed number
        if (!byte) throw new Error("The file has no muons of a sphere: there is no surface to be set.");
        byte[0] = surface;
    }
    return bytes;
}

/**
 * The bytes that hold the number of an initializer, if there is one such number.
 *
 * @param {Uint8Array<ArrayBuffer>} model
 * @param {string} name of the initializer
 * @param {number} data the field of numbers of its type, where they are not raw
 */
function placeOf(model, name, data) {
    const named = new TextEncoder().encode(name).join();
    const places = [];
    for (const graph of fields(model)) {
        if (graph.number !== GRAPH) continue;
        for (const tensor of fields(graph.bytes)) {
            if (tensor.number !== INITIALIZER) continue;
            const inside = [...fields(tensor.bytes)];
            if (!inside.some(({ number, bytes }) => number === NAME && bytes.join() === named)) continue;
            places.push(...inside.filter(({ number, bytes }) => [data, RAW_DATA].includes(number) && bytes.length > 0));
        }
    }
    return places.length === 1 ? places[0].bytes : undefined;
}

/**
 * The fields of a message of Protocol Buffers.
 *
 * @param {Uint8Array<ArrayBuffer>} message
 * @returns {Generator<{number: number, bytes: Uint8Array<ArrayBuffer>, whole: Uint8Array<ArrayBuffer>}>} their bytes,
 *     and these with the number and the size before them
 */
export function* fields(message) {
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
        const start = at;
        const tag = varint();
        const type = tag % 8;
        let begin = at;
        if (type === 0) {
            varint();
        } else {
            const size = type === 1 ? 8 : type === 2 ? varint() : type === 5 ? 4 : Infinity;
            if (size > message.length - at) throw new Error("The file is no ONNX file: a field is cut off.");
            begin = at;
            at += size;
        }
        yield {
            number: Math.floor(tag / 8),
            bytes: message.subarray(begin, at),
            whole: message.subarray(start, at),
        };
    }
}
