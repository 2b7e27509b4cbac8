/** The live page in Chromium, on the built site. `npm run test:browser`; site.js says where the site is. */

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFile } from "node:fs/promises";
import { after, before, test } from "node:test";
import { isFamily } from "../../../docs/live/models.js";
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
 * @param {{depth?: number | string, metres?: number, architecture?: string, number?: string, seed?: string}} wanted
 */
async function generate(page, { depth, metres, architecture, number = "50000", seed = "" }) {
    if (depth !== undefined) await page.getByLabel("Depth").selectOption(String(depth));
    if (architecture !== undefined) await page.getByLabel("Architecture").selectOption(architecture);
    if (metres !== undefined) await page.getByLabel("Metres of water").fill(String(metres));
    await page.getByLabel("Muons", { exact: true }).fill(number);
    await page.getByLabel("Seed").fill(seed);
    await page.getByRole("button", { name: "Generate" }).click();
}

/**
 * What has to be chosen for a model, of a family at the depth that it says.
 *
 * @param {import("../../../docs/live/models.js").Model} model
 */
function choicesOf(model) {
    const { depth_m, architecture } = model;
    return isFamily(model) ? { depth: "any", metres: depth_m, architecture } : { depth: depth_m, architecture };
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
function muonsOfPackage({ depth_m, architecture }, number, seed) {
    const program = `
import json
from deepmuon_runtime import Generator
muons = Generator.open(${depth_m}, architecture="${architecture}").sample(${number}, seed=${seed})
columns = (muons.kinetic_energy, muons.u, muons.v, muons.w, muons.pdg_id)
print(json.dumps([column.tolist() for column in columns]))`;
    /** @type {number[][]} */
    const columns = JSON.parse(execFileSync(PYTHON, ["-c", program], { encoding: "utf-8", maxBuffer: 1e9 }));
    return columns[0].map((_, i) => columns.map((column) => column[i]));
}

testPage("every released model gives the muons that the package makes of the same seed", async (page) => {
    const number = 20_000;
    for (const model of released.models) {
        await generate(page, { ...choicesOf(model), number: "2e4", seed: "1" });
        await finished(page);
        const { name, header, muons } = await saveCsv(page);
        assert.equal(name, `muons-${model.architecture}-${model.depth_m}m-seed-1.csv`);
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
    const model = /** @type {import("../../../docs/live/models.js").Model} */ (
        released.models.find(({ held_out }) => held_out)
    );
    const held = /** @type {import("../../../docs/live/models.js").Counts} */ (model.held_out).by_energy;
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
    await tabTo("depth");
    await page.keyboard.press("End");
    await tabTo("architecture");
    await tabTo("number");
    await page.keyboard.press("Control+A");
    await page.keyboard.type("20000");
    await tabTo("seed");
    await page.keyboard.type("5");
    await page.keyboard.press("Enter");
    await finished(page);
    assert.equal(await focused(), "generate");
    const deepest = Math.max(...released.models.map(({ depth_m }) => depth_m));
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
            await generate(page, { depth: 0 });
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

/** A small family in place of the released models: any depth from 0 to 100 m, and what the page knows of it. */
const FAMILY = JSON.parse(
    execFileSync(
        PYTHON,
        [
            "-c",
            `
import base64, json, sys
sys.path.insert(0, "tests")
from support.tiny_families import tiny_family, tiny_rate
from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.opening import checked_model, load_model
content = tiny_family()
_, model, _ = load_model(*checked_model(content, "family.onnx"), "cpu")
fields = "name sha256 architecture flux medium surface depth_m depth_min_m depth_max_m muons_per_draw latent_size"
known = {field: getattr(model, field) for field in f"{fields} energy_min_gev energy_max_gev rate_hz_per_m2".split()}
known |= {"has_sphere": True, "held_out": None, "rates": [[depth, tiny_rate(depth)] for depth in range(0, 101)]}
print(json.dumps({"content": base64.b64encode(content).decode(), "model": known}))`,
        ],
        { encoding: "utf-8", cwd: new URL("../../..", import.meta.url) },
    ),
);

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
    path.write_bytes(tiny_family())
    print(json.dumps(Generator.open(${depth}, file=path).sample(${number}, seed=${seed}).kinetic_energy.tolist()))`;
    const cwd = new URL("../../..", import.meta.url);
    return JSON.parse(execFileSync(PYTHON, ["-c", program], { encoding: "utf-8", cwd }));
}

/**
 * The page with the family among its models, and no other.
 *
 * @param {Page} page
 */
async function openWithFamily(page) {
    const fixed = released.models.filter((model) => !isFamily(model));
    await page
        .context()
        .route("**/live/models.json", (route) =>
            route.fulfill({ json: { ...released, models: [...fixed, FAMILY.model] } }),
        );
    await page
        .context()
        .route("**/live/models/family.onnx", (route) => route.fulfill({ body: Buffer.from(FAMILY.content, "base64") }));
    await open(page);
}

const withoutWorkers = { serviceWorkers: /** @type {const} */ ("block"), complaints: /blocked by Playwright/ };

testPage(
    "a family offers any depth, and gives the muons that the package makes of it there",
    async (page) => {
        const fields = [page.locator("#slider"), page.getByLabel("Metres of water")];
        await page.getByLabel("Depth").selectOption("0");
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
            assert.equal(name, `muons-quantile-${depth}m-seed-5.csv`);
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
        await page.keyboard.press("ArrowLeft");
        await page
            .getByRole("status")
            .getByText(/The spectrum under 9\d/)
            .waitFor();
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
        assert.equal(await page.locator("#metres-note").innerText(), "How deep? From 0 to 100 m, such as 13.7.");
        await page.getByLabel("Depth").selectOption("10");
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

/**
 * What the worker says of a target.
 *
 * @param {Page} page
 * @param {import("../../../docs/live/models.js").Model} model
 * @param {string} kind
 * @param {number[]} sizes
 * @returns {Promise<{hz: number, hits: number[]}>}
 */
function aimOfPage(page, model, kind, sizes) {
    return page.evaluate(async ([address, model, kind, sizes]) => {
        const { Engine } = await import(`${address}live/engine.js`);
        const engine = new Engine();
        const { hz, hits } = await engine.ask("aim", model, kind, sizes, 7n);
        engine.close();
        return { hz, hits: [...hits] };
    }, /** @type {const} */ ([site.address, model, kind, sizes]));
}

/**
 * The same by the package: the rate, and of a sphere, which rejects nothing, the first muons.
 *
 * @param {string} open a Python expression for the generator
 * @param {string} kind
 * @param {number[]} sizes
 * @returns {{hz: number, muons: number[][]}}
 */
function aimOfPackage(open, kind, sizes) {
    const program = `
import json, sys, tempfile, pathlib
sys.path.insert(0, "tests")
from support.tiny_families import tiny_family
from deepmuon_runtime import Generator
from deepmuon_runtime.targets.by_name import target_of
with tempfile.TemporaryDirectory() as folder:
    path = pathlib.Path(folder, "family.onnx")
    path.write_bytes(tiny_family())
    generator = ${open}
    target = target_of("${kind}", ${JSON.stringify(sizes)})
    muons = generator.sample(1000, seed=7, target=target)
    columns = (muons.kinetic_energy, muons.u, muons.v, muons.w, muons.x, muons.y, muons.z)
    rows = list(zip(*(column.tolist() for column in columns)))
    print(json.dumps({"hz": generator.rate(target=target).hz, "muons": rows}))`;
    const cwd = new URL("../../..", import.meta.url);
    return JSON.parse(
        execFileSync(PYTHON, ["-W", "ignore", "-c", program], { encoding: "utf-8", cwd, maxBuffer: 1e9 }),
    );
}

const TARGETS = /** @type {[string, number[]][]} */ ([
    ["box", [4, 4, 3]],
    ["cylinder", [0.5, 8]],
    ["sphere", [2]],
]);

testPage(
    "a target has the rate that the package says, and a sphere its muons and where they enter",
    async (page) => {
        await openWithFamily(page);
        const depth = 10;
        /** @type {[import("../../../docs/live/models.js").Model, string][]} */
        const families = [[{ ...FAMILY.model, depth_m: depth }, `Generator.open(${depth}, file=path)`]];
        for (const model of released.models.filter(({ has_sphere }) => has_sphere)) {
            families.push([
                { ...model, depth_m: depth },
                `Generator.open(${depth}, architecture="${model.architecture}")`,
            ]);
        }
        for (const [model, open] of families) {
            for (const [kind, sizes] of TARGETS) {
                const { hz, hits } = await aimOfPage(page, model, kind, sizes);
                const expected = aimOfPackage(open, kind, sizes);
                assert.ok(Math.abs(hz / expected.hz - 1) < 1e-3, `${model.name}, ${kind}: ${hz}, not ${expected.hz}`);
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
        await page.getByLabel("Depth").selectOption("0");
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
        await generate(page, {});
        await finished(page);
        assert.ok(await rateOfTarget(page).isVisible());
        await page.getByLabel("Depth").selectOption("10");
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
        const missing = "**/live/models/family.onnx";
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
