/**
 * A family as two models, so that another depth needs no loading: one makes the tables of a depth, the other, of these
 * and latents, muons. Loading a family anew folds some hundred nodes, which takes a browser a quarter of a second.
 */

import { fields } from "./family.js";

// Numbers of fields in https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
const GRAPH = 7;
const OF_GRAPH = { node: 1, name: 2, initializer: 5, input: 11, output: 12 };
const OF_NODE = { input: 1, output: 2 };
const NAME_OF_TENSOR = 8;
const NAME_OF_VALUE = 1;

/** @type {Record<string, number>} */
const TYPES = { float32: 1, int32: 6, int64: 7 };

/** What the first of the models takes, each a single number. */
const ASKED = { depth_m: "float32", surface: "int32" };

/** @typedef {Uint8Array<ArrayBuffer>} Bytes */
/** @typedef {{whole: Bytes, inputs: string[], outputs: string[]}} Node */
/** @typedef {Record<string, {type: string, dims: readonly number[]}>} Kinds of tensors, by name */

export class Split {
    /** @param {ArrayBuffer} contents of a family's ONNX file */
    constructor(contents) {
        const model = [...fields(new Uint8Array(contents))];
        const graph = model.filter(({ number }) => number === GRAPH).flatMap(({ bytes }) => [...fields(bytes)]);
        /** @param {number} kind */
        const all = (kind) => graph.filter(({ number }) => number === kind);
        this.around = model.filter(({ number }) => number !== GRAPH).map(({ whole }) => whole);
        this.initializers = all(OF_GRAPH.initializer).map(({ bytes, whole }) => ({
            name: nameIn(bytes, NAME_OF_TENSOR),
            whole,
        }));
        this.inputs = all(OF_GRAPH.input);
        this.outputs = all(OF_GRAPH.output).map(({ bytes, whole }) => ({ name: nameIn(bytes, NAME_OF_VALUE), whole }));
        const taken = new Set(this.inputs.map(({ bytes }) => nameIn(bytes, NAME_OF_VALUE)));
        /** @type {Node[]} */
        this.ofMuons = [];
        /** @type {Node[]} */
        this.ofDepth = [];
        for (const { bytes, whole } of all(OF_GRAPH.node)) {
            const node = { whole, inputs: namesIn(bytes, OF_NODE.input), outputs: namesIn(bytes, OF_NODE.output) };
            const isOfMuons = node.inputs.some((name) => taken.has(name));
            (isOfMuons ? this.ofMuons : this.ofDepth).push(node);
            if (isOfMuons) for (const name of node.outputs) taken.add(name);
        }
        const wanted = new Set([
            ...this.ofMuons.flatMap(({ inputs }) => inputs),
            ...this.outputs.map(({ name }) => name),
        ]);
        /** Names of what goes from the first to the second, and of outputs that the first has already. */
        this.tables = this.ofDepth.flatMap(({ outputs }) => outputs.filter((name) => wanted.has(name)));
    }

    /** The model that makes the tables: it takes `depth_m` and `surface`. */
    modelOfTables() {
        const asked = Object.entries(ASKED).filter(([name]) => this.initializers.some((other) => other.name === name));
        return this.model(
            this.ofDepth,
            asked.map(([name, type]) => field(OF_GRAPH.input, valueOf(name, type, []))),
            this.tables.map((name) => field(OF_GRAPH.output, field(NAME_OF_VALUE, letters(name)))),
            asked.map(([name]) => name),
        );
    }

    /**
     * The model that makes muons: it takes what the family does, and those of the tables that it needs.
     *
     * @param {Kinds} kinds of the tables
     */
    modelOfMuons(kinds) {
        const taken = new Set(this.ofMuons.flatMap(({ inputs }) => inputs));
        const made = new Set(this.ofMuons.flatMap(({ outputs }) => outputs));
        const given = this.tables.filter((name) => taken.has(name));
        return this.model(
            this.ofMuons,
            [
                ...this.inputs.map(({ whole }) => whole),
                ...given.map((name) => field(OF_GRAPH.input, valueOf(name, kinds[name].type, kinds[name].dims))),
            ],
            this.outputs.filter(({ name }) => made.has(name)).map(({ whole }) => whole),
            given,
        );
    }

    /**
     * @param {Node[]} nodes
     * @param {Bytes[]} inputs
     * @param {Bytes[]} outputs
     * @param {string[]} given names of inputs, which are no initializers
     * @returns {Bytes}
     */
    model(nodes, inputs, outputs, given) {
        const taken = new Set(nodes.flatMap(({ inputs }) => inputs));
        for (const name of given) taken.delete(name);
        const constants = this.initializers.filter(({ name }) => taken.has(name)).map(({ whole }) => whole);
        const graph = joined([
            ...nodes.map(({ whole }) => whole),
            field(OF_GRAPH.name, letters("part")),
            ...constants,
            ...inputs,
            ...outputs,
        ]);
        return joined([...this.around, field(GRAPH, graph)]);
    }
}

/**
 * An input of a graph.
 *
 * @param {string} name
 * @param {string} type
 * @param {readonly number[]} dims
 */
function valueOf(name, type, dims) {
    const shape = joined(dims.map((size) => field(1, number(1, size))));
    const tensor = joined([number(1, TYPES[type]), field(2, shape)]);
    return joined([field(NAME_OF_VALUE, letters(name)), field(2, field(1, tensor))]);
}

/**
 * @param {Bytes} message
 * @param {number} kind
 */
function namesIn(message, kind) {
    return [...fields(message)]
        .filter(({ number }) => number === kind)
        .map(({ bytes }) => new TextDecoder().decode(bytes));
}

/**
 * @param {Bytes} message
 * @param {number} kind
 */
function nameIn(message, kind) {
    return namesIn(message, kind).join("");
}

/** @param {string} text */
function letters(text) {
    return new TextEncoder().encode(text);
}

/**
 * A field of Protocol Buffers that holds bytes.
 *
 * @param {number} number
 * @param {Bytes} bytes
 */
function field(number, bytes) {
    return joined([varint(8 * number + 2), varint(bytes.length), bytes]);
}

/**
 * A field that holds a number.
 *
 * @param {number} field
 * @param {number} value
 */
function number(field, value) {
    return joined([varint(8 * field), varint(value)]);
}

/** @param {number} value */
function varint(value) {
    const bytes = [];
    for (; value >= 128; value = Math.floor(value / 128)) bytes.push((value % 128) + 128);
    return Uint8Array.from([...bytes, value]);
}

/** @param {Bytes[]} parts */
function joined(parts) {
    const whole = new Uint8Array(parts.reduce((size, { length }) => size + length, 0));
    let at = 0;
    for (const part of parts) {
        whole.set(part, at);
        at += part.length;
    }
    return whole;
}
