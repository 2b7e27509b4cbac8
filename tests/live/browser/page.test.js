/** The live page in Chromium, on the built site. `npm run test:browser`; site.js says where the site is. */

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFile } from "node:fs/promises";
import { after, before, test } from "node:test";
import { familyAt, isFamily } from "../../../docs/live/models.js";
import { openBrowser, serveSite } from "./site.js";

const PYTHON = process.env.PYTHON ?? "python";
const PATIENCE = 120_000; // ms; a machine may be slow

/** @typedef {import("playwright-core").Page} Page */

/** @type {Awaited<ReturnType<typeof serveSite>>} */
let site;
/** @type {import("../../../docs/live/models.js").Released} */
let released;

before(async () => {
    site = await serveSite();
    released = await (await fetch(`${site.address}live/models.json`)).json();
});

after(() => site.close());

/**
 * A test of the page in a browser of its own: nothing may be asked of other machines, and nothing complain.
 *
 * @param {string} name
 * @param {(page: Page) => Promise<void>} body
 * @param {import("playwright-core").BrowserContextOptions & {complaints?: RegExp}} [options]
 */
function testPage(name, body, { complaints, ...options } = {}) {
    test(name, { timeout: 5 * PATIENCE }, async () => {
        const { context, close } = await openBrowser({ viewport: { width: 1280, height: 900 }, ...options });
        /** @type {string[]} */
        const troubles = [];
        context.on("request", (request) => {
            if (!/^(blob:)?http:\/\/localhost:/.test(request.url())) troubles.push(`asked for ${request.url()}`);
        });
        context.on("console", (message) => {
            if (["error", "warning"].includes(message.type())) troubles.push(message.text());
        });
        context.on("weberror", (error) => troubles.push(error.error().message));
        try {
            const page = await context.newPage();
            page.setDefaultTimeout(PATIENCE);
            await open(page);
            await body(page);
            assert.deepEqual(
                troubles.filter((text) => !complaints?.test(text)),
                [],
            );
        } finally {
            await close();
        }
    });
}

/** @param {Page} page */
async function open(page) {
    await page.goto(`${site.address}live/`);
    await page.locator("#generate:enabled").waitFor();
}

/**
 * @param {Page} page
 * @param {Choices & {number?: string, seed?: string}} wanted
 */
async function generate(page, { number = "50000", seed = "", ...choices }) {
    await pick(page, choices);
    await page.getByLabel("Muons", { exact: true }).fill(number);
    await page.getByLabel("Seed").fill(seed);
    await page.getByRole("button", { name: "Generate" }).click();
}

/** @typedef {{flux?: string, medium?: string, architecture?: string, depth?: number | string, metres?: number}} Choices */

/**
 * Pick a model.
 *
 * @param {Page} page
 * @param {Choices} choices
 */
async function pick(page, { metres, ...choices }) {
    for (const [name, value] of Object.entries(choices)) {
        const select = page.locator(`#${name}`);
        if (value !== "any" || (await select.isVisible())) await select.selectOption(String(value));
    }
    if (metres !== undefined) await page.locator("#metres").fill(String(metres));
}

/**
 * What has to be chosen for a model, of a family at the depth that it says.
 *
 * @param {import("../../../docs/live/models.js").Model} model
 * @returns {Choices}
 */
function choicesOf(model) {
    const { flux, medium, architecture, depth_m } = model;
    const depth = isFamily(model) ? { depth: "any", metres: depth_m } : { depth: depth_m };
    return { flux, medium, architecture, ...depth };
}

/**
 * A model that was judged by muons, of a family at a depth where it was.
 *
 * @returns {import("../../../docs/live/models.js").Model & {held_out: import("../../../docs/live/models.js").Counts}}
 */
function judged() {
    const judged = released.models.flatMap((model) =>
        isFamily(model) ? model.held_out_at.slice(0, 1).map(([depth]) => familyAt(model, depth)) : [model],
    );
    return /** @type {any} */ (judged.find(({ held_out }) => held_out));
}

/** @param {Page} page */
async function finished(page) {
    await page.getByRole("status").getByText(" muons in ").waitFor();
    await page.locator("#generate:enabled").waitFor();
}

/** @param {Page} page */
async function saveCsv(page) {
    const [file] = await Promise.all([
        page.waitForEvent("download"),
        page.getByRole("button", { name: "Save" }).click(),
    ]);
    const lines = (await readFile(await file.path(), "utf-8")).trimEnd().split("\n");
    return {
        name: file.suggestedFilename(),
        header: lines[0],
        muons: lines.slice(1).map((line) => line.split(",").map(Number)),
    };
}

/**
 * The same muons by the package, as rows of the CSV.
 *
 * @param {import("../../../docs/live/models.js").Model} model
 * @param {number} number
 * @param {number} seed
 * @returns {number[][]}
 */
function muonsOfPackage(model, number, seed) {
    const program = `
import json
from deepmuon_runtime import Generator
muons = ${opening(model)}.sample(${number}, seed=${seed})
columns = (muons.kinetic_energy, muons.u, muons.v, muons.w, muons.pdg_id)
print(json.dumps([column.tolist() for column in columns]))`;
    /** @type {number[][]} */
    const columns = JSON.parse(execFileSync(PYTHON, ["-c", program], { encoding: "utf-8", maxBuffer: 1e9 }));
    return columns[0].map((_, i) => columns.map((column) => column[i]));
}

/**
 * A Python expression for the generator of a released model.
 *
 * @param {import("../../../docs/live/models.js").Model} model
 */
function opening(model) {
    const file = `__import__("importlib.resources").resources.files("deepmuon_models") / "${model.name}"`;
    return `Generator.open(${isFamily(model) ? model.depth_m : "None"}, file=${file})`;
}

testPage("every released model gives the muons that the package makes of the same seed", async (page) => {
    const number = 20_000;
    for (const model of released.models) {
        await generate(page, { ...choicesOf(model), number: "2e4", seed: "1" });
        await finished(page);
        const { name, header, muons } = await saveCsv(page);
        assert.equal(name, `muons-${model.flux}-${model.medium}-${model.architecture}-${model.depth_m}m-seed-1.csv`);
        assert.equal(header, "kinetic_energy_GeV,u,v,w,pdg_id");
        assert.equal(muons.length, number);
        let otherCharges = 0;
        for (const [i, expected] of muonsOfPackage(model, number, 1).entries()) {
            const relative = muons[i][0] / expected[0] - 1;
            assert.ok(Math.abs(relative) < 1e-4, `${model.name}: energy ${i} is off by ${relative}`);
            for (const axis of [1, 2, 3]) {
                assert.ok(Math.abs(muons[i][axis] - expected[axis]) < 1e-5, `${model.name}: direction ${i}`);
            }
            otherCharges += muons[i][4] === expected[4] ? 0 : 1;
        }
        assert.ok(otherCharges <= 2, `${otherCharges} charges differ`); // rounding decides where chance is at its threshold
        const mean = muons.reduce((sum, [energy]) => sum + energy, 0) / number;
        assert.equal(await page.locator("#mean").textContent(), `${mean.toFixed(2)} GeV`);
        assert.equal(await page.locator("#made").textContent(), "20,000");
        assert.equal(await page.locator("#unphysical").textContent(), "0");
    }
});

testPage("the energies fill the spectrum of muons kept out of the training", async (page) => {
    const model = judged();
    const held = model.held_out.by_energy;
    await generate(page, { ...choicesOf(model), number: "2e5", seed: "3" });
    await finished(page);
    const { muons } = await saveCsv(page);
    const total = held.reduce((sum, count) => sum + count, 0);
    const above10 = held.slice(31).reduce((sum, count) => sum + count, 0) / total;
    const found = muons.filter(([energy]) => energy >= 10).length / muons.length;
    // Five standard errors, with a fixed seed.
    assert.ok(Math.abs(found - above10) < 5 * Math.sqrt((above10 * (1 - above10)) / muons.length + 1 / total));
});

testPage("Stop ends a run early, and what was made can be saved", async (page) => {
    await generate(page, { number: "10,000,000" });
    await page.locator("#made").getByText(/\d/).waitFor();
    await page.getByRole("button", { name: "Stop" }).click();
    await finished(page);
    const [, made] = /** @type {RegExpMatchArray} */ (
        (await page.getByRole("status").innerText()).match(/^Stopped: ([\d,]+) muons/)
    );
    const number = Number(made.replaceAll(",", ""));
    assert.ok(number > 0 && number < 1e7);
    assert.equal((await saveCsv(page)).muons.length, number);
});

testPage("a run without a seed is a new one, and the command that is shown has its seed", async (page) => {
    const runs = [];
    for (let i = 0; i < 2; i++) {
        await generate(page, { number: "1000" });
        await finished(page);
        runs.push({ command: await page.locator("#command").innerText(), ...(await saveCsv(page)) });
    }
    assert.notDeepEqual(runs[0].muons, runs[1].muons);
    const [, seed] = /** @type {RegExpMatchArray} */ (runs[0].command.match(/ -n 1000 --seed (\d+) /));
    await generate(page, { number: "1000", seed });
    await finished(page);
    assert.deepEqual((await saveCsv(page)).muons, runs[0].muons);
});

testPage("the keyboard is enough, and shows where it is", async (page) => {
    const focused = () => page.evaluate(() => document.activeElement?.id ?? "");
    /** @param {string} id */
    const tabTo = async (id) => {
        for (let i = 0; i < 60 && (await focused()) !== id; i++) await page.keyboard.press("Tab");
        assert.equal(await focused(), id);
        const outline = await page.evaluate(
            () => getComputedStyle(/** @type {Element} */ (document.activeElement)).outlineWidth,
        );
        assert.equal(outline, "3px");
    };
    await tabTo("flux");
    await tabTo("medium");
    await tabTo("architecture");
    await page.keyboard.press("End");
    await tabTo("depth");
    await page.keyboard.press("End");
    await tabTo("number");
    await page.keyboard.press("Control+A");
    await page.keyboard.type("20000");
    await tabTo("seed");
    await page.keyboard.type("5");
    await page.keyboard.press("Enter");
    await finished(page);
    assert.equal(await focused(), "generate");
    const fixed = released.models.filter((model) => !isFamily(model));
    const deepest = Math.max(...fixed.map(({ depth_m }) => depth_m));
    assert.match(await page.locator("#command").innerText(), new RegExp(`--depth ${deepest} .* -n 20000 --seed 5 `));
    await tabTo("save");
    const [file] = await Promise.all([page.waitForEvent("download"), page.keyboard.press("Enter")]);
    assert.match(file.suggestedFilename(), /\.csv$/);
    await tabTo("motion");
    await page.keyboard.press("Space");
    assert.equal(await page.locator("#motion").innerText(), "Play the sky");
});

testPage("a wrong number or seed is explained at its field, which gets the focus", async (page) => {
    for (const [wrong, field, text] of [
        [{ number: "many" }, "Muons", "How many muons?"],
        [{ number: "1e9" }, "Muons", "10,000,000 muons at most"],
        [{ seed: "-1" }, "Seed", "A seed is a whole number"],
    ]) {
        await generate(page, /** @type {object} */ (wrong));
        const input = page.getByLabel(/** @type {string} */ (field), { exact: field === "Muons" });
        assert.ok(await input.evaluate((element) => element === document.activeElement));
        assert.equal(await input.getAttribute("aria-invalid"), "true");
        const note = await page.locator(`#${await input.getAttribute("aria-describedby")}`).innerText();
        assert.ok(note.includes(/** @type {string} */ (text)), note);
        assert.equal(await page.locator("#made").innerText(), "–");
    }
});

testPage(
    "a telephone's width holds the page",
    async (page) => {
        await generate(page, {});
        await finished(page);
        const width = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.equal(width, 360);
        for (const chart of ["#energy svg", "#zenith svg", "#sky"]) {
            const box = /** @type {{x: number, width: number}} */ (await page.locator(chart).boundingBox());
            assert.ok(box.x >= 0 && box.x + box.width <= 360 && box.width > 250, chart);
        }
    },
    { viewport: { width: 360, height: 740 }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 },
);

for (const colorScheme of /** @type {const} */ (["light", "dark"])) {
    testPage(
        `everything can be read in the ${colorScheme} theme`,
        async (page) => {
            await generate(page, choicesOf(judged()));
            await finished(page);
            await page.getByLabel("Seed").fill("-1");
            const background = luminance(await style(page, "body", "background-color"));
            assert.ok(colorScheme === "dark" ? background < 0.1 : background > 0.9);
            for (const [selector, property, least] of /** @type {[string, string, number][]} */ ([
                [".live [role=status]", "color", 4.5],
                [".live #figures dt", "color", 4.5],
                [".live #seed-note", "color", 4.5],
                [".live .tick", "fill", 4.5],
                [".live polyline.generated", "stroke", 3],
                [".live .points", "fill", 3],
            ])) {
                const ratio = contrast(luminance(await style(page, selector, property)), background);
                assert.ok(ratio >= least, `${selector}: ${ratio.toFixed(2)}`);
            }
        },
        { colorScheme },
    );
}

/**
 * @param {Page} page
 * @param {string} selector
 * @param {string} property
 */
function style(page, selector, property) {
    return page
        .locator(selector)
        .first()
        .evaluate((element, name) => getComputedStyle(element).getPropertyValue(name), property);
}

/**
 * Relative luminance, as the Web Content Accessibility Guidelines 2.2 define it.
 *
 * @param {string} colour "rgb(r, g, b)"
 */
function luminance(colour) {
    const [red, green, blue] = /** @type {RegExpMatchArray} */ (colour.match(/[\d.]+/g)).map((part) => {
        const share = Number(part) / 255;
        return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

/**
 * @param {number} one luminance
 * @param {number} other
 */
function contrast(one, other) {
    return (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
}

testPage("the sky moves, and can be paused", async (page) => {
    await generate(page, {});
    await finished(page);
    const [first, second] = await twoSkies(page);
    assert.notEqual(first, second);
    await page.getByRole("button", { name: "Pause the sky" }).click();
    const [third, fourth] = await twoSkies(page);
    assert.equal(third, fourth);
});

testPage(
    "who asked for less motion sees a sky at rest",
    async (page) => {
        const [empty] = await twoSkies(page);
        await generate(page, {});
        await finished(page);
        const [first, second] = await twoSkies(page);
        assert.equal(first, second);
        assert.notEqual(first, empty);
        await page.getByRole("button", { name: "Play the sky" }).click();
        await page.waitForFunction((still) => document.querySelector("canvas")?.toDataURL() !== still, first);
    },
    { reducedMotion: "reduce" },
);

/** @param {Page} page */
function twoSkies(page) {
    return twoPictures(page, "#sky");
}

/**
 * A moving picture, and what it is after ten frames more.
 *
 * @param {Page} page
 * @param {string} selector
 */
function twoPictures(page, selector) {
    return page.evaluate(async (selector) => {
        const canvas = /** @type {HTMLCanvasElement} */ (document.querySelector(selector));
        const first = canvas.toDataURL();
        for (let i = 0; i < 10; i++) await new Promise(requestAnimationFrame);
        return [first, canvas.toDataURL()];
    }, selector);
}

test("once loaded, the page works without a network, every model too", { timeout: PATIENCE * 5 }, async () => {
    const own = await serveSite();
    const { context, close } = await openBrowser();
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE);
    try {
        await page.goto(`${own.address}live/`);
        await page.getByText("it works without a network").waitFor();
        await own.close();
        await context.setOffline(true);
        await page.reload();
        await page.locator("#generate:enabled").waitFor();
        for (const model of released.models) {
            await generate(page, { ...choicesOf(model), number: "1000" });
            await finished(page);
            assert.equal(await page.locator("#made").innerText(), "1,000");
        }
        const rules = await page.evaluate(
            () => [...document.styleSheets].filter((sheet) => sheet.cssRules.length > 0).length,
        );
        assert.ok(rules >= 3, "the theme's style sheets are kept too");
    } finally {
        await close();
    }
});

for (const [file, what] of [
    ["models/*.onnx", "The model"],
    ["engine/ort-wasm-simd-threaded.wasm", "ONNX Runtime"],
    ["engine/ort.wasm.bundle.min.mjs", "ONNX Runtime"],
    ["engine/random.wasm", "The generator of random numbers"],
]) {
    testPage(
        `a missing ${file} is told in words, and the page goes on when it is there again`,
        async (page) => {
            await page.context().route(`**/live/${file}`, (route) => route.fulfill({ status: 404 }));
            await generate(page, {});
            const alert = page.getByRole("alert").filter({ hasText: "could not be fetched: the site answers 404" });
            assert.ok((await alert.innerText()).startsWith(what));
            await page.context().unrouteAll();
            await generate(page, {});
            await finished(page);
            assert.equal(await page.getByRole("alert").innerText(), "");
        },
        { serviceWorkers: "block", complaints: /404|blocked by Playwright/ },
    );
}

testPage(
    "a damaged model is told in words",
    async (page) => {
        await page.context().route("**/live/models/*.onnx", (route) => route.fulfill({ body: "no model" }));
        await generate(page, {});
        await page.getByRole("alert").filter({ hasText: "is damaged, or newer than this page" }).waitFor();
    },
    { serviceWorkers: "block", complaints: /blocked by Playwright/ },
);

/**
 * A small family and what the page knows of it.
 *
 * @param {string} options of the package's tiny family
 * @param {(depth: number) => number} rateAt
 * @returns {{content: Buffer, model: import("../../../docs/live/models.js").Family}}
 */
function familyOf(options, rateAt) {
    const program = `
import base64, json, sys
sys.path.insert(0, "tests")
import numpy as np
from support.tiny_families import tiny_family
from deepmuon_runtime.model.opening import checked_model, load_model
content = tiny_family(${options})
_, model, _ = load_model(*checked_model(content, "family.onnx"), "cpu")
fields = "sha256 architecture flux medium surface depth_m depth_min_m depth_max_m muons_per_draw latent_size"
known = {field: getattr(model, field) for field in f"{fields} energy_min_gev energy_max_gev rate_hz_per_m2".split()}
known |= {"has_sphere": True, "held_out": None, "held_out_at": [], "options": ""}
print(json.dumps({"content": base64.b64encode(content).decode(), "model": known}))`;
    const cwd = new URL("../../..", import.meta.url);
    const { content, model } = JSON.parse(execFileSync(PYTHON, ["-c", program], { encoding: "utf-8", cwd }));
    const depths = Array.from({ length: 101 }, (_, i) => (i / 100) * model.depth_max_m);
    return {
        content: Buffer.from(content, "base64"),
        model: {
            ...model,
            name: `tiny-${model.flux}-${model.medium}.onnx`,
            rates: depths.map((depth) => [depth, rateAt(depth)]),
        },
    };
}

/**
 * @param {number} depth
 * @param {[number, number][]} known the least depth first
 */
function linearly(depth, known) {
    const above = Math.max(
        1,
        known.findIndex(([other]) => other >= depth),
    );
    const [[upper, first], [lower, second]] = known.slice(above - 1, above + 1);
    return first + ((second - first) * (depth - upper)) / (lower - upper);
}

/** A family in place of the released ones: any depth from 0 to 100 m of water. */
const FAMILY = familyOf('{"flux": "cry"}', (depth) =>
    linearly(depth, [
        [0, 110],
        [50, 10],
        [100, 2],
    ]),
);

/** Another one: of another flux, through as much rock that a muon comes in weeks. */
const DEEP = familyOf(
    `{"flux": "measured", "medium": "rock", "depth_max_m": "5000"}, changes={
        "spacing": np.float32(2500),
        "maps/rate": np.float32([[[110], [1e-3], [1e-6]], [[150], [1e-3], [1e-6]]]),
    }`,
    (depth) =>
        linearly(depth, [
            [0, 110],
            [2500, 1e-3],
            [5000, 1e-6],
        ]),
);
DEEP.model.options = "--flux measured --medium rock ";

/**
 * The muons of the family at a depth by the package.
 *
 * @param {number} depth
 * @param {number} number
 * @param {number} seed
 * @returns {number[]} their energies
 */
function familysEnergies(depth, number, seed) {
    const program = `
import json, sys, tempfile, pathlib
sys.path.insert(0, "tests")
from support.tiny_families import tiny_family
from deepmuon_runtime import Generator
with tempfile.TemporaryDirectory() as folder:
    path = pathlib.Path(folder, "family.onnx")
    path.write_bytes(tiny_family({"flux": "cry"}))
    print(json.dumps(Generator.open(${depth}, file=path).sample(${number}, seed=${seed}).kinetic_energy.tolist()))`;
    const cwd = new URL("../../..", import.meta.url);
    return JSON.parse(execFileSync(PYTHON, ["-c", program], { encoding: "utf-8", cwd }));
}

/**
 * The page with the families among its models, and no others.
 *
 * @param {Page} page
 */
async function openWithFamily(page) {
    const fixed = released.models.filter(({ architecture }) => architecture === TRANSFORMER.architecture);
    const families = [FAMILY, DEEP];
    const models = [...families.map(({ model }) => model), ...fixed];
    await page
        .context()
        .route("**/live/models.json", (route) => route.fulfill({ json: { default: FAMILY.model.name, models } }));
    for (const { model, content } of families) {
        await page.context().route(`**/live/models/${model.name}`, (route) => route.fulfill({ body: content }));
    }
    await open(page);
}

const TRANSFORMER = { flux: "cry", medium: "water", architecture: "transformer" };

const withoutWorkers = { serviceWorkers: /** @type {const} */ ("block"), complaints: /blocked by Playwright/ };

testPage(
    "a family offers any depth, and gives the muons that the package makes of it there",
    async (page) => {
        const fields = [page.locator("#slider"), page.getByLabel("Metres of water")];
        await pick(page, { ...TRANSFORMER, depth: 0 });
        for (const field of fields) assert.ok(await field.isHidden());
        await openWithFamily(page);
        for (const field of fields) assert.ok(await field.isVisible());
        for (const depth of [13.7, 0, 100]) {
            await page.getByLabel("Metres of water").fill(String(depth));
            await page.getByRole("status").getByText("The spectrum ").waitFor();
            await generate(page, { number: "1000", seed: "5" });
            await finished(page);
            assert.match(await page.locator("#command").innerText(), new RegExp(`--depth ${depth} `));
            const { name, muons } = await saveCsv(page);
            assert.equal(name, `muons-cry-water-quantile-${depth}m-seed-5.csv`);
            for (const [i, energy] of familysEnergies(depth, 1000, 5).entries()) {
                assert.ok(Math.abs(muons[i][0] / energy - 1) < 1e-5, `energy ${i} at ${depth} m`);
            }
        }
    },
    withoutWorkers,
);

testPage(
    "the spectrum moves with the slider",
    async (page) => {
        await openWithFamily(page);
        const slider = page.getByLabel("Slide through the water");
        const curve = page.locator("#energy polyline.generated").first();
        const seen = new Set();
        for (const share of [0, 250, 500, 1000]) {
            await slider.fill(String(share));
            const metres = await page.getByLabel("Metres of water").inputValue();
            const place = metres === "0" ? "at sea level" : `under ${metres} m of water`;
            await page.getByRole("status").getByText(`The spectrum ${place}, of 32,768 muons.`).waitFor();
            seen.add(await curve.getAttribute("points"));
        }
        assert.equal(seen.size, 4);
        await slider.focus();
        for (const [key, depth] of [
            ["ArrowLeft", 80],
            ["PageDown", 10],
            ["ArrowUp", 12],
            ["End", 100],
        ]) {
            await page.keyboard.press(/** @type {string} */ (key));
            assert.equal(await page.getByLabel("Metres of water").inputValue(), String(depth));
            await page.getByRole("status").getByText(`The spectrum under ${depth} m of water`).waitFor();
        }
        assert.equal(await slider.getAttribute("aria-valuetext"), "100 m of water, 2 muons a second and square metre");
    },
    withoutWorkers,
);

testPage(
    "flux, medium, architecture and depth are chosen among what there is",
    async (page) => {
        await openWithFamily(page);
        /** @param {string} id */
        const offered = (id) => page.locator(`#${id} option`).allInnerTexts();
        assert.deepEqual(await offered("flux"), ["CRY’s", "measured"]);
        assert.deepEqual(await offered("architecture"), ["quantile", "transformer"]);
        assert.ok(await page.locator("#depth").isHidden());
        await page.locator("#metres").fill("28");
        await pick(page, { architecture: "transformer" });
        assert.ok(await page.locator("#slider").isHidden());
        assert.equal(await page.locator("#depth").inputValue(), "30");
        await pick(page, { flux: "measured" });
        assert.deepEqual(await offered("medium"), ["rock"]);
        assert.deepEqual(await offered("architecture"), ["quantile"]);
        assert.equal(await page.getByLabel("Metres of rock").inputValue(), "30");
        await generate(page, { metres: 4000, number: "1000", seed: "5" });
        await finished(page);
        assert.equal(
            await page.locator("#command").innerText(),
            "deepmuon-gen --flux measured --medium rock --depth 4000 --architecture quantile -n 1000 --seed 5 -o muons.h5",
        );
        await pick(page, { flux: "cry" });
        assert.equal(await page.getByLabel("Metres of water").inputValue(), "100");
    },
    withoutWorkers,
);

testPage(
    "where a muon comes in weeks, axes and words follow, and time can go faster",
    async (page) => {
        await openWithFamily(page);
        for (const pace of ["#pace", "#target-pace"]) assert.ok(await page.locator(pace).isHidden());
        await pick(page, { flux: "measured", metres: 5000 });
        await page.getByRole("status").getByText("The spectrum under 5000 m of rock").waitFor();
        await page.getByText("31.6 muons a year under 5000 m of rock, one in 2 weeks").waitFor();
        const chart = await page.locator("#energy").innerText();
        assert.ok(chart.includes("m⁻² year⁻¹") && chart.includes("10⁵"), chart);
        await choose(page, "sphere", [0.5]);
        await page.getByText("24.8 muons a year enter it under 5000 m of rock, one in 2 weeks.").waitFor();
        await page.getByText("--sphere 0.5 --live-time 31557600").waitFor();
        const [first, second] = await twoPictures(page, "#sky");
        assert.equal(first, second);
        for (const pace of ["#pace", "#target-pace"]) await page.locator(pace).selectOption("a year a second");
        for (const picture of ["#sky", "#target-drawing"]) {
            await page.waitForTimeout(500);
            const [before, after] = await twoPictures(page, picture);
            assert.notEqual(before, after);
        }
        await page.locator("#metres").fill("2500");
        await page.getByText("3.6 muons an hour under 2500 m of rock").waitFor();
        assert.ok(!(await page.locator("#pace option").allInnerTexts()).includes("a year a second"));
        assert.ok((await page.locator("#pace").inputValue()) !== "1");
    },
    withoutWorkers,
);

testPage(
    "a depth that a family has not is explained at its field",
    async (page) => {
        await openWithFamily(page);
        await generate(page, {});
        await finished(page);
        await page.getByLabel("Metres of water").fill("101");
        await page.getByRole("button", { name: "Generate" }).click();
        const input = page.getByLabel("Metres of water");
        assert.ok(await input.evaluate((element) => element === document.activeElement));
        assert.equal(await page.locator("#metres-note").innerText(), "How deep? From 0 to 100 m.");
        await pick(page, { architecture: "transformer" });
        assert.ok(await input.isHidden());
        await generate(page, {});
        await finished(page);
    },
    withoutWorkers,
);

/**
 * Choose a target.
 *
 * @param {Page} page
 * @param {string} kind
 * @param {number[]} [sizes] its own where none are given
 */
async function choose(page, kind, sizes = []) {
    await page.getByLabel("Target", { exact: true }).selectOption(kind);
    for (const [i, size] of sizes.entries()) await page.locator(`#size-${i + 1}`).fill(String(size));
}

/** @param {Page} page */
function rateOfTarget(page) {
    return page.locator("#target-note").getByText("muons a second enter it");
}

const TARGETS = /** @type {[string, number[]][]} */ ([
    ["box", [4, 4, 3]],
    ["cylinder", [0.5, 8]],
    ["sphere", [2]],
]);

/**
 * What the worker says of each target.
 *
 * @param {Page} page
 * @param {import("../../../docs/live/models.js").Model} model
 * @returns {Promise<{hz: number, hits: number[], ends: {depth_m: number, flux: number}[] | undefined}[]>}
 */
function aimsOfPage(page, model) {
    return page.evaluate(async ([address, model, targets]) => {
        const { Engine } = await import(`${address}live/engine.js`);
        const engine = new Engine();
        const found = [];
        for (const [kind, sizes] of targets) {
            const { hz, hits, ends } = await engine.ask("aim", model, kind, sizes, 7n);
            found.push({ hz, hits: [...hits], ends });
        }
        engine.close();
        return found;
    }, /** @type {const} */ ([site.address, model, TARGETS]));
}

/**
 * The same by the package: rates, of a sphere, which rejects nothing, the first muons, and what is warned of.
 *
 * @param {string} open a Python expression for the generator
 * @returns {{hz: number, muons: number[][], warned: string[]}[]}
 */
function aimsOfPackage(open) {
    const program = `
import json, sys, tempfile, pathlib, warnings
sys.path.insert(0, "tests")
from support.tiny_families import tiny_family
from deepmuon_runtime import Generator
from deepmuon_runtime.targets.by_name import target_of
found = []
with tempfile.TemporaryDirectory() as folder:
    path = pathlib.Path(folder, "family.onnx")
    path.write_bytes(tiny_family({"flux": "cry"}))
    generator = ${open}
    for kind, sizes in ${JSON.stringify(TARGETS)}:
        target = target_of(kind, sizes)
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            muons = generator.sample(1000, seed=7, target=target)
        columns = (muons.kinetic_energy, muons.u, muons.v, muons.w, muons.x, muons.y, muons.z)
        rows = list(zip(*(column.tolist() for column in columns)))
        texts = [str(one.message) for one in warned]
        found.append({"hz": generator.rate(target=target).hz, "muons": rows, "warned": texts})
print(json.dumps(found))`;
    const cwd = new URL("../../..", import.meta.url);
    return JSON.parse(execFileSync(PYTHON, ["-c", program], { encoding: "utf-8", cwd, maxBuffer: 1e9 }));
}

testPage(
    "a target has the rates that the package says, at its ends too, and a sphere its muons and where they enter",
    async (page) => {
        await openWithFamily(page);
        const depth = 10;
        /** @type {[import("../../../docs/live/models.js").Model, string][]} */
        const families = [[{ ...FAMILY.model, depth_m: depth }, `Generator.open(${depth}, file=path)`]];
        for (const model of released.models.filter(({ has_sphere }) => has_sphere)) {
            families.push([{ ...model, depth_m: depth }, opening({ ...model, depth_m: depth })]);
        }
        for (const [model, open] of families) {
            const [ofPage, ofPackage] = [await aimsOfPage(page, model), aimsOfPackage(open)];
            for (const [target, [kind]] of TARGETS.entries()) {
                const { hz, hits, ends } = ofPage[target];
                const expected = ofPackage[target];
                assert.ok(Math.abs(hz / expected.hz - 1) < 1e-3, `${model.name}, ${kind}: ${hz}, not ${expected.hz}`);
                const said = ends?.map(({ depth_m, flux }) => [flux, depth_m]).flat() ?? [];
                const warned = expected.warned.join().match(/: (\S+) a .* at (\S+) m, and (\S+) .* at (\S+) m$/) ?? [];
                assert.equal(said.length, expected.warned.length * 4, `${model.name}, ${kind}: ${expected.warned}`);
                for (const [i, number] of warned.slice(1).entries()) {
                    // The package knows a rate to five digits.
                    assert.ok(Math.abs(said[i] / Number(number) - 1) < 1e-4, `${said}, not ${expected.warned}`);
                }
                if (kind !== "sphere") continue;
                for (const [i, [energy, ...rest]] of expected.muons.entries()) {
                    const [found, ...others] = hits.slice(7 * i, 7 * i + 7);
                    assert.ok(Math.abs(found / energy - 1) < 1e-4, `${model.name}: energy ${i}`);
                    for (const [k, number] of rest.entries()) {
                        assert.ok(Math.abs(others[k] - number) < 1e-4, `${model.name}: muon ${i}`);
                    }
                }
            }
        }
    },
    withoutWorkers,
);

testPage(
    "a target is offered where a family is picked, and its rate follows its sizes and the depth",
    async (page) => {
        await pick(page, { ...TRANSFORMER, depth: 0 });
        assert.ok(await page.getByLabel("Target", { exact: true }).isHidden());
        await openWithFamily(page);
        assert.ok(await page.locator("#target-drawing").isHidden());
        const seen = new Set();
        for (const [kind, sizes] of TARGETS) {
            await choose(page, kind, sizes);
            await page.getByText(`--${kind} ${sizes.join(" ")} --live-time 60`).waitFor();
            seen.add(await rateOfTarget(page).innerText());
            const label = `A ${kind} of ${sizes.join(" × ")} m, with points where muons enter it`;
            assert.ok(await page.getByRole("img", { name: label }).isVisible());
            assert.equal(await page.locator("#size-3").isVisible(), kind === "box");
        }
        await page.getByLabel("Metres of water").fill("80");
        await rateOfTarget(page).getByText("under 80 m of water").waitFor();
        seen.add(await rateOfTarget(page).innerText());
        assert.equal(seen.size, TARGETS.length + 1);
        const text = await page.locator("#target-ends").innerText();
        assert.match(
            text,
            /^The sphere gets .* at 80 m, all over: .* a second .* top, at 78 m, and .* foot, at 82 m.$/,
        );
        await page.getByLabel("Metres of water").fill("0");
        await rateOfTarget(page).getByText("at sea level").waitFor();
        assert.equal(await page.locator("#target-ends").innerText(), "");
        await generate(page, {});
        await finished(page);
        assert.ok(await rateOfTarget(page).isVisible());
        await pick(page, { architecture: "transformer" });
        assert.ok(await page.locator("#target-drawing").isHidden());
    },
    withoutWorkers,
);

testPage(
    "the muons of a target come one by one, and can be paused by the keyboard",
    async (page) => {
        await openWithFamily(page);
        const choice = page.getByLabel("Target", { exact: true });
        await choice.focus();
        await page.keyboard.press("ArrowDown");
        await rateOfTarget(page).waitFor();
        const [first, second] = await twoPictures(page, "#target-drawing");
        assert.notEqual(first, second);
        for (let i = 0; i < 4; i++) await page.keyboard.press("Tab"); // three sizes, and the button
        await page.keyboard.press("Space");
        assert.equal(await page.locator("#target-motion").innerText(), "Play the muons");
        const [third, fourth] = await twoPictures(page, "#target-drawing");
        assert.equal(third, fourth);
        const arrived = await page.evaluate(async (address) => {
            const { Drawing } = await import(`${address}live/target/drawing.js`);
            const { bodyOf } = await import(`${address}live/target/bodies.js`);
            const drawing = new Drawing(document.createElement("canvas"));
            drawing.clock.playing = true;
            drawing.show(bodyOf("sphere", [1]), 50, Float32Array.of(1, 0, 0, -1, 0, 0, 1));
            for (let i = 0; i < 100; i++) drawing.advance(1);
            return drawing.arrived;
        }, site.address);
        assert.ok(Math.abs(arrived - 5000) < 5 * Math.sqrt(5000), `${arrived} in 100 s`); // one in two million fails
    },
    withoutWorkers,
);

testPage(
    "who asked for less motion sees a target with its muons at rest, and a new one when it changes",
    async (page) => {
        await openWithFamily(page);
        await choose(page, "cylinder");
        await rateOfTarget(page).waitFor();
        const [first, second] = await twoPictures(page, "#target-drawing");
        assert.equal(first, second);
        await choose(page, "cylinder", [1, 9]);
        await page.getByText("--cylinder 1 9 ").waitFor();
        const [third] = await twoPictures(page, "#target-drawing");
        assert.notEqual(third, first);
        await page.getByRole("button", { name: "Play the muons" }).click();
        const [fourth, fifth] = await twoPictures(page, "#target-drawing");
        assert.notEqual(fourth, fifth);
    },
    { ...withoutWorkers, reducedMotion: "reduce" },
);

testPage(
    "a size that a target can't have is explained at its field",
    async (page) => {
        await openWithFamily(page);
        await choose(page, "box", [4, 0]);
        const input = page.getByLabel("Width along y / m");
        assert.equal(await input.getAttribute("aria-invalid"), "true");
        assert.match(await page.locator("#target-note").innerText(), /^How large\? From 0.1 to 10 m/);
        await choose(page, "");
        assert.ok(await page.locator("#target-note").isHidden());
        await choose(page, "box", [4, 2]);
        await rateOfTarget(page).waitFor();
        assert.equal(await input.getAttribute("aria-invalid"), "false");
    },
    withoutWorkers,
);

testPage(
    "a family that can't be had is told beside the target, which is there as soon as it can",
    async (page) => {
        await openWithFamily(page);
        const missing = `**/live/models/${FAMILY.model.name}`;
        /** @param {import("playwright-core").Route} route */
        const refuse = (route) => route.fulfill({ status: 404 });
        await page.context().route(missing, refuse);
        await choose(page, "box");
        await page.locator("#target-note").getByText("could not be fetched: the site answers 404").waitFor();
        assert.ok(await page.locator("#target-drawing").isHidden());
        await page.context().unroute(missing, refuse);
        await choose(page, "box", [3]);
        await rateOfTarget(page).waitFor();
    },
    { ...withoutWorkers, complaints: /404|blocked by Playwright/ },
);

testPage(
    "a telephone's width holds a target",
    async (page) => {
        await openWithFamily(page);
        await choose(page, "box");
        await rateOfTarget(page).waitFor();
        assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 360);
        const box = /** @type {{x: number, width: number}} */ (await page.locator("#target-drawing").boundingBox());
        assert.ok(box.x >= 0 && box.x + box.width <= 360 && box.width > 250);
        await page.getByRole("button", { name: "Pause the muons" }).tap();
        assert.equal(await page.locator("#target-motion").innerText(), "Play the muons");
    },
    { ...withoutWorkers, viewport: { width: 360, height: 740 }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 },
);
