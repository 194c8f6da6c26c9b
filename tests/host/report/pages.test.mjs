// SPDX-License-Identifier: Apache-2.0
/**
 * Pages of identify, validate, plan, diagnose and report as a browser shows them: on a phone and on a desk, light, dark and
 * on paper, without scripts, without WebGL.
 */
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {readFileSync, statSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {after, before, test} from 'node:test';

import {chain, measuredPoint, toolFrame} from '../../../host/report/web/src/chain.js';
import {jointsOf, lengthText, norm, readData, shown, tickText} from '../../../host/report/web/src/data.js';
import {launch, marks, open, picture, settled} from './browser.mjs';

const source = process.env.FLEXCOMP_SOURCE_DIR;
const folder = process.env.FLEXCOMP_PAGES;
const robot = join(source, 'host/robots/tx60l.yaml');
const truth = join(source, 'tests/data/tx60l_table1.yaml');
const at = (name) => join(folder, name);
const largestPage = 1500000;

/** Exit status 5 is a result too: what stands on the page then is what this is about. */
function flexcomp(...args) {
  try {
    return execFileSync(join(process.env.FLEXCOMP_BIN_DIR, 'flexcomp'), args, {cwd: folder, stdio: 'pipe', encoding: 'utf8'});
  } catch (error) {
    if (error.status === 5) return error.stdout;
    throw new Error(`flexcomp ${args.join(' ')}: ${error.stderr}`);
  }
}
const simulate = (file, ...more) => flexcomp('simulate', '--robot', robot, '--quiet', ...more, '-o', file);
const context = ['--context', '--payloads', '0,1.108', '--noise', 'N1'];

/** A table by its columns. */
function csv(file) {
  const [head, ...rows] = readFileSync(at(file), 'utf8').trim().split('\n').map((line) => line.split(','));
  return Object.fromEntries(head.map((name, k) => [name, rows.map((row) => Number(row[k]))]));
}
/** The joints of row k of a table. */
const jointsAt = (table, k) => [1, 2, 3, 4, 5, 6].map((j) => table[`q${j}_deg`][k]);
const jointsHead = 'q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg';
function dataOf(name) {
  const [, text] = readFileSync(at(name), 'utf8').match(/<script type="application\/json" id="data">(.*?)<\/script>/s);
  return readData(text);
}

/** Nothing is wider than the window. */
async function expectToFit(page, where) {
  const [wide, room] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(wide <= room, `${where}: ${wide} px wide`);
}
const chooseError = (page, kind) => page.locator('.explore select').first().selectOption(kind);
const sumOf = (list) => list.reduce((a, b) => a + b);

/** A test on an opened page, on which nothing may go wrong. */
function pageTest(name, file, body, options) {
  test(name, async () => {
    const {page, troubles, close} = await open(browser, at(file), options);
    await body(page);
    assert.deepEqual(troubles, []);
    await close();
  });
}

const longName = 'm'.repeat(78);
const pages = {
  identify: 'identify.html', validate: 'validate.html', plan: 'plan.html', diagnose: 'diagnose.html', report: 'report.html',
};
let browser;

before(async () => {
  simulate('fitted.csv', '--truth', truth, '--poses', '60', '--seed', '3', ...context);
  simulate('others.csv', '--truth', truth, '--poses', '30', '--seed', '33', ...context);
  writeFileSync(at('hidden.yaml'), `${readFileSync(truth, 'utf8')}
  - {effect: gear_harmonic, joint: 3, order: 2, sin_rad: 3.0e-4, cos_rad: 1.0e-4}\n`);
  simulate('hidden.csv', '--truth', 'hidden.yaml', '--poses', '100', '--seed', '3', ...context);
  simulate('kept.csv', '--truth', 'hidden.yaml', '--poses', '60', '--seed', '4', ...context);
  flexcomp('identify', '--robot', robot, '--data', 'fitted.csv', '-o', 'cal.yaml', '--report', pages.identify);
  flexcomp('validate', '--robot', robot, '--calibration', 'cal.yaml', '--data', 'others.csv', '--report', pages.validate,
    '--json', 'validated.json');
  flexcomp('plan', '--robot', robot, '--cell', join(source, 'docs/examples/cell.yaml'), '--poses', '14', '--payloads',
    '0,1.108', '--effort', '0.1', '--extend', 'others.csv', '-o', 'plan.csv', '--report', pages.plan);
  flexcomp('diagnose', '--robot', robot, '--data', 'hidden.csv', '--holdout', 'kept.csv', '-o', 'found.yaml', '--report',
    pages.diagnose);
  // The files of where an arm went: here the joints of the data with made-up errors, a row's own number among them.
  const others = csv('others.csv');
  const row = (k, size) => [...jointsAt(others, k), size, 0, -size / (k + 1), k % 2].join(',');
  for (const [name, size] of [['went_before.csv', 1], ['went_after.csv', 0.1]]) {
    writeFileSync(at(name), `${[`${jointsHead},dx_mm,dy_mm,dz_mm,payload_kg`, ...others.q1_deg.map((_, k) => row(k, size))].join('\n')}\n`);
  }
  flexcomp('report', '--robot', robot, '--calibration', 'cal.yaml', '--errors', 'There=went_before.csv,went_after.csv',
    '--errors', 'Back=went_after.csv,went_after.csv', '--result', 'Others=validated.json', '--title', `</script><b>title ${longName}`,
    '--summary', `A summary ${longName}`, '--fact', `${longName}=${longName}`, '--link', `${longName}.html=${longName}`,
    '-o', pages.report);
  browser = await launch();
});
after(() => browser?.close());

test('the arm is drawn where the forward model has it', () => {
  writeFileSync(at('one.csv'), `${jointsHead},dx_mm,dy_mm,dz_mm\n0,0,0,0,0,0,1,0,0\n`);
  const names = ['abb-irb120', 'kuka-kr6-r900', 'rx160l', 'tx60l', 'ur10', 'ur5'];
  // None of them has beta; one that has is made.
  const skewed = readFileSync(robot, 'utf8').replace(/(theta_deg:[^}]*?)(beta_deg: *[-\d.]+ *, *)?(min_deg)/g, '$1beta_deg: 7, $3');
  assert.notEqual(skewed, readFileSync(robot, 'utf8'));
  writeFileSync(at('skewed.yaml'), skewed);
  for (const name of [...names, 'skewed']) {
    const file = name === 'skewed' ? at('skewed.yaml') : join(source, `host/robots/${name}.yaml`);
    // Inside the limits of all of them.
    writeFileSync(at('joints.csv'), [jointsHead, '10,20,-30,40,50,60', '-80,-35,25,-70,-20,100',
      '0,0,0,0,0,0'].join('\n'));
    flexcomp('predict', '--robot', file, '--joints', 'joints.csv', '-o', 'there.csv', '--force');
    flexcomp('report', '--robot', file, '--errors', 'One=one.csv,one.csv', '-o', 'arm.html');
    const {arm} = dataOf('arm.html');
    const there = csv('there.csv');
    for (let k = 0; k < 3; ++k) {
      const q = jointsAt(csv('joints.csv'), k).map((v) => (v * Math.PI) / 180);
      const p = measuredPoint(arm, q);
      ['x_mm', 'y_mm', 'z_mm'].forEach((key, i) => assert.ok(Math.abs(p[i] * 1e3 - there[key][k]) < 1e-3,
        `${name}, pose ${k + 1}: ${p[i] * 1e3} and ${there[key][k]}`));
      // The tool's z axis against the predicted quaternion: a wrong rotation may leave the point alone.
      const [w, x, y, z] = ['qw', 'qx', 'qy', 'qz'].map((key) => there[key][k]);
      const axis = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
      const drawn = toolFrame(arm, chain(arm, q)[6]).z;
      axis.forEach((v, i) => assert.ok(Math.abs(v - drawn[i]) < 1e-6, `${name}, pose ${k + 1}: ${drawn} and ${axis}`));
    }
  }
});

test('the numbers of the page are those of the data', () => {
  const {sets: [set]} = dataOf(pages.identify);
  const data = csv('fitted.csv');
  assert.equal(set.count, 60);
  for (let k = 0; k < 60; ++k) {
    for (let j = 0; j < 6; ++j) assert.ok(Math.abs((jointsOf(set, k)[j] * 180) / Math.PI - data[`q${j + 1}_deg`][k]) < 6e-4);
    assert.equal(set.line[k], k + 2);
  }
  const covariate = (start) => set.covariates.find((c) => c.name.startsWith(start)).values;
  for (const [name, column, start] of [['payload', 'payload_kg', 0], ['temperature', 'temp_c', 0],
    ['time since the first row [s]', 'time_s', data.time_s[0]]]) {
    covariate(name).forEach((v, k) => assert.ok(Math.abs(v - (data[column][k] - start)) <= 1e-3 * Math.max(...data[column].map(Math.abs)),
      `${name} ${v} ${data[column][k]}`));
  }
  // Before: the nominal arm's error, as validate counts it of the same rows.
  flexcomp('validate', '--robot', robot, '--calibration', 'cal.yaml', '--data', 'fitted.csv', '--json', 'same.json');
  const same = JSON.parse(readFileSync(at('same.json'), 'utf8'));
  const mean = (which) => Array.from({length: 60}, (_, k) => norm(set.error(which, k))).reduce((a, b) => a + b) / 60;
  assert.ok(Math.abs(mean('before') - same.before.nominal_frames.mean_mm) < 1e-4);
  assert.ok(Math.abs(mean('after') - same.after.mean_mm) < 1e-4);
});

test('errors are drawn in the frame of the arm, wherever the instrument stands', () => {
  // The same arm without noise, measured from two places, by a model that leaves much of the error: what is left is the
  // same vector of the arm.
  const left = ['0,0,0,0,0,0', '-2100,340,55,20,-35,130'].map((frame, n) => {
    simulate(`place${n}.csv`, '--truth', truth, '--poses', '40', '--seed', '9', '--noise', 'none', '--frame', frame);
    flexcomp('identify', '--robot', robot, '--data', `place${n}.csv`, '--model', 'geometric', '--frames', 'fit', '--plain', '-o',
      `place${n}.yaml`, '--report', `place${n}.html`);
    return dataOf(`place${n}.html`).sets[0];
  });
  for (let k = 0; k < 40; ++k) {
    const [a, b] = left.map((set) => set.errorInBase('after', k));
    assert.ok(norm(a) > 0.01);
    a.forEach((v, i) => assert.ok(Math.abs(v - b[i]) < 0.02 * norm(a) + 2e-3, `pose ${k + 1}: ${a} and ${b}`));
  }
  // What carries is on the page, with its uncertainty; and "before" says which frames it had.
  const text = readFileSync(at('place1.html'), 'utf8');
  const carriers = [...text.matchAll(/absorbed by (.*?)<\/li>/g)].flatMap((m) => [...m[1].matchAll(/<code>(.*?)<\/code>/g)].map((c) => c[1]));
  assert.ok(carriers.some((name) => name.startsWith('frame_')), `${carriers}`);
  for (const name of carriers) assert.match(text, new RegExp(`<th scope="row">${name.replace(/[[\].]/g, '\\$&')}</th><td>-?[\\d.e-]+</td><td>[\\d.e-]+</td>`));
  assert.match(text, /before: nominal model, frames fitted/);
  assert.match(text, /nominal model, frames nominal: mean \[mm\]/);
  const nominal = readFileSync(at(pages.identify), 'utf8');
  assert.match(nominal, /before: nominal model &nbsp/);
  assert.match(nominal, /nominal model, frames fitted: mean \[mm\]/);
});

const said = {
  identify: ['Parameters', 'Cannot be told apart', 'Which model?', 'geometry alone', 'without link gravity', 'base.z_mm'],
  validate: ['Poses that were not fitted', 'Parameters'],
  plan: ['The plan', 'What to expect'],
  diagnose: ['How the gap shrinks', 'Where', 'What was found', 'gear_harmonic[joint=3,order=2]', 'comes twice per turn'],
  report: ['A summary', 'There', 'Back', 'Other data', '</script><b>title'],
};
for (const [command, file] of Object.entries(pages)) {
  test(`${command}: one file, small, and whole on a phone and on a desk, light and dark`, async () => {
    assert.ok(statSync(at(file)).size <= largestPage, `${statSync(at(file)).size} bytes`);
    const all = [[390, 'dark'], [1280, 'light'], ...(command === 'identify' ? [[390, 'light'], [1280, 'dark']] : [])];
    for (const [width, scheme] of all) {
      const {page, troubles, close} = await open(browser, at(file), {width, scheme});
      const where = `${command}, ${width} px, ${scheme}`;
      await expectToFit(page, where);
      const seen = await picture(page);
      assert.ok(seen.filled > 2000 && seen.colours > 20, `${where}: the arm is not to be seen: ${JSON.stringify(seen)}`);
      if (command !== 'plan') {
        assert.ok(seen.near.before > 30, `${where}: no errors: ${JSON.stringify(seen)}`);
        for (const plot of ['.scatter', '.histogram']) assert.ok(await marks(page, plot) >= 24, `${where}: ${plot} is empty`);
      }
      const paper = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
      const [light] = paper.match(/\d+/g).map(Number);
      assert.ok(scheme === 'dark' ? light < 60 : light > 200, `${where}: ${paper}`);
      const text = await page.innerText('main');
      for (const word of said[command]) assert.ok(text.includes(word), `${where}: no "${word}"`);
      assert.deepEqual(troubles, [], where);
      await page.screenshot({path: at(`${command}_${width}_${scheme}.png`), fullPage: true});
      if (scheme === all[0][1] && width === 390) {
        // The narrowest that there is, with every name as long as it may be.
        await page.setViewportSize({width: 320, height: 700});
        await settled(page);
        await expectToFit(page, `${command}, 320 px`);
        const outside = await page.evaluate(() => [...document.querySelectorAll('main *')]
          .filter((e) => e.getBoundingClientRect().right > innerWidth + 1 && !e.closest('.scroll, svg')).map((e) => `${e.tagName}.${e.className}`));
        assert.deepEqual(outside, [], `${command}, 320 px`);
      }
      await close();
    }
  });
}

pageTest('before, after, and how long they are drawn', pages.identify, async (page) => {
  const words = () => page.textContent('.scale');
  const times = async () => Number((await words()).match(/drawn ([\d,]+) times/)[1].replaceAll(',', ''));
  const chooseErrors = async (which) => {
    await page.check(`.view3d .choice input[value=${which}]`, {force: true});
    await settled(page);
    return picture(page);
  };
  const first = await times();
  const both = await picture(page);
  const onlyAfter = await chooseErrors('after');
  assert.ok(onlyAfter.near.before < both.near.before / 20, 'the errors before are still there');
  assert.ok(onlyAfter.near.after > 200, JSON.stringify(onlyAfter));
  assert.ok(await times() > first, 'the small errors after are drawn longer');
  const onlyBefore = await chooseErrors('before');
  assert.equal(await times(), first);
  assert.ok(onlyBefore.near.before > 500);
  await page.locator('.view3d .length').fill('0');
  await settled(page);
  assert.ok(await times() < first);
  assert.ok((await picture(page)).near.before < onlyBefore.near.before / 3, 'shorter arrows cover less');
  // One square of the grid in mm of error follows from the two numbers beside it.
  const [, square, error] = (await words()).match(/grid: ([\d.]+) mm of the arm, ([\d.]+) mm of error/);
  assert.ok(Math.abs(Number(square) / await times() / Number(error) - 1) < 0.01, await words());
});

pageTest('the view turns, comes nearer, and goes to a pose', pages.identify, async (page) => {
  const seen = [(await picture(page)).sum];
  const change = async (what, action) => {
    await action();
    await settled(page);
    await page.waitForTimeout(50);
    seen.push((await picture(page)).sum);
    assert.equal(new Set(seen).size, seen.length, `${what} changes nothing`);
  };
  const box = await page.locator('.stage').boundingBox();
  await change('dragging', async () => {
    await page.mouse.move(box.x + 300, box.y + 200);
    await page.mouse.down();
    await page.mouse.move(box.x + 420, box.y + 240, {steps: 4});
    await page.mouse.up();
  });
  await change('nearer', () => page.click('button[aria-label=nearer]'));
  await change('from above', () => page.getByRole('button', {name: 'above'}).click());
  await change('the next pose', () => page.click('button[aria-label="the next pose"]'));
  assert.match(await page.textContent('.view3d .readout'), /^Pose 2 of 60 \(line 3\)/);
  await change('without bodies', () => page.getByLabel('bodies (capsules)').uncheck());
  // The wheel belongs to the page until the view was clicked; then it brings the arm nearer.
  await page.evaluate(() => document.activeElement.blur());
  await page.mouse.move(box.x + 300, box.y + 200);
  const scrolled = () => page.evaluate(() => scrollY);
  const start = await scrolled();
  await page.mouse.wheel(0, 100);
  await page.waitForFunction((y) => scrollY > y, start);
});

pageTest('errors against everything that was recorded, and a dot that is clicked', pages.identify, async (page) => {
  const against = page.locator('.explore select').nth(1);
  const names = await against.locator('option').allTextContents();
  for (const wanted of ['q1 [deg]', 'q2 [deg]', 'q3 [deg]', 'q4 [deg]', 'q5 [deg]', 'q6 [deg]', 'payload [kg]',
    'temperature [°C]', 'time since the first row [s]', 'order of the data']) assert.ok(names.includes(wanted), `${wanted} of ${names}`);
  for (const kind of ['size', 'x', 'turned']) {
    await chooseError(page, kind);
    for (let k = 0; k < names.length; ++k) {
      await against.selectOption(String(k));
      await settled(page);
      assert.equal(await marks(page, '.scatter'), 120, `${kind} against ${names[k]}`);
    }
    assert.equal(await marks(page, '.histogram'), 32);
  }
  // Every dot says its pose, and is where that pose's value is; clicked, the arm goes there.
  await chooseError(page, 'size');
  await against.selectOption({label: 'q1 [deg]'});
  const {q1_deg: values} = csv('fitted.csv');
  const [low, high] = [Math.min(...values), Math.max(...values)];
  await settled(page);
  const inSight = async () => {
    await page.waitForTimeout(400);  // the page may still be scrolling to the arm
    await page.locator('.scatter').scrollIntoViewIfNeeded();
    return page.locator('.scatter .frame').boundingBox();
  };
  let plot = await inSight();
  let clicked = 0;
  for (let share = 0.1; share < 1 && clicked < 3; share += 0.13) {
    for (let down = 0.02; down < 1; down += 0.08) {
      await page.mouse.move(plot.x + share * plot.width, plot.y + down * plot.height);
      const said = await page.textContent('.explore .readout');
      const pose = said.match(/^Pose (\d+) \(line (\d+)\): q1 \[deg\] (-?[\d.]+)/);
      if (!pose) continue;
      const value = values[Number(pose[1]) - 1];
      assert.equal(pose[1], String(Number(pose[2]) - 1));
      assert.ok(Math.abs(Number(pose[3]) - value) <= 0.006 * Math.abs(value) + 1e-3, `${said} ${value}`);
      // The axis reaches 3 % further than the values on both sides; a dot is read from 24 pixels away.
      const expected = ((value - low) / (high - low) + 0.03) / 1.06;
      assert.ok(Math.abs(expected - share) * plot.width < 25, `${said} ${share} ${expected}`);
      await page.mouse.down();
      await page.mouse.up();
      assert.match(await page.textContent('.view3d .readout'), new RegExp(`^Pose ${pose[1]} of 60`));
      ++clicked;
      plot = await inSight();
      break;
    }
  }
  assert.ok(clicked >= 2, 'no dot was found');
});

pageTest('a component has no logarithm, and what is left has classes of its own', pages.identify, async (page) => {
  const {sets: [set]} = dataOf(pages.identify);
  const box = page.getByLabel('logarithmic');
  const panels = () => page.locator('.histogram svg').count();
  assert.ok(await box.isChecked());
  assert.equal(await panels(), 1);
  for (const kind of ['x', 'y', 'z']) {
    await chooseError(page, kind);
    assert.ok(await box.isDisabled() && !(await box.isChecked()), kind);
    assert.equal(await panels(), 2, 'before and after by themselves: the one is a single bar among the classes of the other');
    for (const which of ['before', 'after']) {
      const values = Array.from({length: 60}, (_, k) => set.error(which, k)['xyz'.indexOf(kind)]);
      const {edges, counts} = set.histogram(kind, which, false);
      assert.ok(edges[0] <= Math.min(...values) + 1e-4 && edges.at(-1) >= Math.max(...values) - 1e-4);
      assert.equal(sumOf(counts[which]), 60);
      assert.ok(counts[which].filter((n) => n > 0).length >= 6, `${kind} ${which}: ${counts[which]}`);
    }
  }
  await page.check('.explore .choice input[value=after]', {force: true});
  assert.equal(await panels(), 1);
  assert.match(await page.getAttribute('.histogram', 'aria-label'), /of 60 poses: after most often from/);
  await chooseError(page, 'size');
  assert.ok(await box.isChecked() && await box.isEnabled());
});

test('numbers keep their digits and ticks their length', () => {
  assert.deepEqual([0, 1.234, 0.00123, 4e-7].map(shown), ['0', '1.23', '0.00123', '< 0.00001']);
  assert.deepEqual([0, 1.234, -4e-5, 4e-7, 1e-12].map(lengthText), ['0 mm', '1.23 mm', '-0.0400 µm', '0.400 nm', '< 0.001 nm']);
  assert.deepEqual([0, 0.05, 2500, 1e-5, 5e-12, 1763749284, null].map(tickText),
    ['0', '0.05', '2500', '10⁻⁵', '5·10⁻¹²', '1.76375·10⁹', '']);
});

test('a lost context comes back with its picture', async () => {
  const {page, troubles, close} = await open(browser, at(pages.identify), {width: 600});
  const seen = await picture(page);
  await page.evaluate(async () => {
    const canvas = document.querySelector('.stage canvas');
    const lose = canvas.getContext('webgl2').getExtension('WEBGL_lose_context');
    const event = (name) => new Promise((done) => { canvas.addEventListener(name, done, {once: true}); });
    const [lost, back] = [event('webglcontextlost'), event('webglcontextrestored')];
    lose.loseContext();
    await lost;
    await new Promise((done) => { setTimeout(done, 0); });
    lose.restoreContext();
    await back;
  });
  await settled(page);
  assert.deepEqual(await picture(page), seen);
  assert.deepEqual(troubles.filter((t) => !/context/i.test(t)), []);
  await close();
});

pageTest('by keyboard and to those who listen', pages.identify, async (page) => {
  const seen = new Set([(await picture(page)).sum]);
  await page.focus('.stage canvas');
  for (const key of ['ArrowLeft', 'ArrowUp', '+', '-']) {
    await page.keyboard.press(key);
    await settled(page);
    const {sum} = await picture(page);
    assert.ok(key === '-' || !seen.has(sum), `${key} changes nothing`);
    seen.add(sum);
  }
  assert.match(await page.getAttribute('.stage canvas', 'aria-label'), /^The arm with the position errors of 60 poses/);
  for (const readout of ['.view3d .readout', '.explore .readout']) assert.equal(await page.getAttribute(readout, 'role'), 'status');
  assert.match(await page.getAttribute('.view3d .length', 'aria-valuetext'), /^[\d,]+ times$/);
  await page.focus('.view3d .length');
  const times = await page.getAttribute('.view3d .length', 'aria-valuetext');
  await page.keyboard.press('ArrowRight');
  assert.notEqual(await page.getAttribute('.view3d .length', 'aria-valuetext'), times);
  // From dot to dot in the order of the axis; the one that is read and the one that was chosen are ringed.
  const rings = (kind) => page.locator(`.scatter .ring.${kind}:visible`).count();
  assert.match(await page.getAttribute('.scatter', 'aria-label'), /position error \[mm\] against q1 \[deg\], 60 poses: before .* mm, after /);
  assert.equal(await rings('chosen'), 2, 'the pose in which the arm stands');
  assert.equal(await rings('found'), 0);
  // The ring is where the dot is: on the axis, which reaches 3 % further than the values on both sides.
  const {q1_deg: q1} = csv('fitted.csv');
  const [low, high] = [Math.min(...q1), Math.max(...q1)];
  const frame = await page.locator('.scatter .frame').evaluate((e) => ({x: e.x.baseVal.value, width: e.width.baseVal.value}));
  const against = page.locator('.explore select').nth(1);
  for (const joint of ['1', '0']) {
    await against.selectOption(joint);
    await settled(page);
  }
  const ringed = await page.locator('.scatter .ring.chosen').first().evaluate((e) => e.cx.baseVal.value);
  assert.ok(Math.abs((ringed - frame.x) / frame.width - ((q1[0] - low) / (high - low) + 0.03) / 1.06) < 0.01, `${ringed} of ${frame.width}`);
  await page.focus('.scatter');
  const values = [];
  for (let k = 0; k < 4; ++k) {
    await page.keyboard.press('ArrowRight');
    values.push(Number((await page.textContent('.explore .readout')).match(/^Pose \d+ .*q1 \[deg\] (-?[\d.]+)/)[1]));
  }
  assert.deepEqual(values, [...values].sort((a, b) => a - b));
  assert.equal(await rings('found'), 2);
  const number = (await page.textContent('.explore .readout')).match(/^Pose (\d+)/)[1];
  await page.keyboard.press('Enter');
  assert.match(await page.textContent('.view3d .readout'), new RegExp(`^Pose ${number} of 60`));
  const place = (kind) => page.locator(`.scatter .ring.${kind}`).first().evaluate((e) => [e.cx.baseVal.value, e.cy.baseVal.value]);
  assert.deepEqual(await place('chosen'), await place('found'));
}, {width: 800});

test('rows that lie apart are marked, and errors that cannot be seen are spoken of', async () => {
  const fitted = csv('fitted.csv');
  const write = (name, error) => writeFileSync(at(name), `${[`${jointsHead},dx_mm,dy_mm,dz_mm`,
    ...Array.from({length: 20}, (_, k) => `${jointsAt(fitted, k)},${error(k)}`)].join('\n')}\n`);
  write('good.csv', (k) => `${0.1 + 0.01 * k},0,0`);
  write('bad.csv', (k) => `${3 + k},1,0`);
  write('tiny.csv', (k) => `${1e-7 * (k + 1)},0,0`);
  write('none.csv', () => '0,0,0');
  const titles = {Worse: 'good.csv,bad.csv', Tiny: 'good.csv,tiny.csv', None: 'good.csv,none.csv'};
  flexcomp('report', '--robot', robot, ...Object.entries(titles).flatMap(([title, files]) => ['--errors', `${title}=${files}`]),
    '-o', 'odd.html');
  const {page, troubles, close} = await open(browser, at('odd.html'), {width: 600});
  assert.match(await page.innerText('.doubts'), /Worse: the errors are larger after than before/);
  assert.doesNotMatch(await page.innerText('main'), /0\.00000/);
  // Arrows that grow are inside the picture too.
  assert.equal((await picture(page)).edge, 0);
  const words = async (title) => {
    await page.locator('.view3d select').selectOption({label: title});
    await settled(page);
    return page.textContent('.scale');
  };
  assert.match(await words('Tiny'), /errors after are too short to be seen at this length: choose “after”/);
  assert.match(await words('None'), /There are no errors after/);
  assert.doesNotMatch(await words('Worse'), /after are too short|no errors/);
  // A linear axis beside a linear drawing, for all three.
  await words('None');
  assert.deepEqual(await page.locator('.explore .check input').evaluateAll((boxes) => boxes.map((b) => b.checked)),
    dataOf('odd.html').sets.map((set) => set.startsLogarithmic('size')));
  await page.locator('.explore').nth(2).getByLabel('logarithmic').check();
  assert.match(await page.locator('.explore').nth(2).innerText(), /Errors of 0 \(20\) lie on the lower edge/);
  assert.deepEqual(troubles, []);
  await close();
  // One pose: the base with its axes is in the picture as well as the arm.
  const one = await open(browser, at('arm.html'), {width: 600});
  assert.equal((await picture(one.page)).edge, 0);
  assert.match(await one.page.innerText('main'), /position error over 1 pose\n/);
  await one.close();
  const even = readFileSync(at(pages.identify), 'utf8');
  writeFileSync(at('apart.html'), even.replace('"outlier":[]', '"outlier":[3,10]'));
  const marked = await open(browser, at('apart.html'), {width: 500});
  const plain = await open(browser, at(pages.identify), {width: 500});
  assert.equal(await marks(marked.page, '.scatter'), await marks(plain.page, '.scatter') + 4, 'diamonds');
  assert.match(await marked.page.innerText('.legend'), /lies far from the rest/);
  assert.notEqual((await picture(marked.page)).sum, (await picture(plain.page)).sum);
  for (const one of [marked, plain]) {
    assert.deepEqual(one.troubles, []);
    await one.close();
  }
});

test('a study: a wide remark wraps, on paper too', async () => {
  flexcomp('study', 'fig3', '--arm', 'tx60l', '--quiet', '--report', 'study.html');
  for (const [width, media] of [[320, 'screen'], [700, 'print']]) {
    const {page, troubles, close} = await open(browser, at('study.html'), {width});
    await page.emulateMedia({media});
    await expectToFit(page, media);
    // Words of the other columns stay whole.
    const lines = await page.locator('tbody th').evaluateAll((cells) =>
      cells.map((e) => { const r = document.createRange(); r.selectNodeContents(e); return r.getClientRects().length; }));
    assert.ok(lines.length === 4 && lines.every((n) => n === 1), `${media}: ${lines}`);
    assert.deepEqual(await page.locator('thead th').allTextContents(), ['arm', 'model', 'parameters', 'paper', 'ours', 'remark']);
    if (media === 'print') {
      const out = await page.locator('td').evaluateAll((cells) => cells.filter((e) => e.getBoundingClientRect().right > innerWidth).length);
      assert.equal(out, 0);
    }
    assert.deepEqual(troubles, []);
    await close();
  }
});

test('the plan has beams, bodies and all its poses', async () => {
  const {page, troubles, close} = await open(browser, at(pages.plan));
  const whole = await picture(page);
  assert.ok(whole.near.before > 100, 'poses that were measured already');
  assert.equal(whole.edge, 0, 'and they are inside the picture');
  assert.ok(whole.near.beam > 300, JSON.stringify(whole));
  assert.match(await page.textContent('.legend'), /planned poses.*beams from the instrument.*bodies/s);
  assert.match(await page.textContent('.view3d .readout'), /^Pose 1 of 14, with [\d.]+ kg; q1/);
  await page.getByLabel('bodies (capsules)').uncheck();
  await settled(page);
  const bare = await picture(page);
  assert.ok(bare.filled < whole.filled * 0.9, 'bodies and floor cover more than the rest');
  await page.getByLabel('all poses').uncheck();
  await settled(page);
  const one = await picture(page);
  assert.ok(one.near.beam < bare.near.beam && one.near.beam > 50, 'the beams of one pose');
  assert.deepEqual(troubles, []);
  await close();
  // One folded pose to come, and the arm stretched out wherever it was measured already.
  const text = readFileSync(at(pages.plan), 'utf8');
  const [, json] = text.match(/id="data">(.*?)<\/script>/s);
  const data = JSON.parse(json);
  const reach = [[0, 0, 0, 0, 0, 0], [0, 90, 0, 0, 0, 0], [120, 90, 0, 0, 0, 0], [-120, 90, 0, 0, 0, 0]];
  Object.assign(data.plan, {q: [0, 0, 150000, 0, 0, 0], payload: [0], known: reach.flat().map((v) => v * 1000), obstacles: []});
  delete data.plan.tracker;
  writeFileSync(at('known.html'), text.replace(json, () => JSON.stringify(data)));
  const known = await open(browser, at('known.html'), {width: 600});
  const all = await picture(known.page);
  assert.ok(all.near.before > 10, JSON.stringify(all));
  assert.equal(all.edge, 0, 'what was measured already leaves the picture');
  await known.close();
});

pageTest('several sets: one is chosen, each has its own plots', pages.report, async (page) => {
  assert.equal(await page.locator('.explore svg').count(), 4);
  assert.deepEqual(dataOf(pages.report).sets.map((s) => s.covariates.some((c) => c.name === 'payload [kg]')), [true, true]);
  const first = await picture(page);
  await page.locator('.view3d select').selectOption({label: 'Back'});
  await settled(page);
  assert.notEqual((await picture(page)).sum, first.sum);
});

test('on paper: drawings for plots, no buttons, light in a dark room too', async () => {
  const shown = (page, selector) => page.evaluate((s) =>
    [...document.querySelectorAll(s)].filter((e) => e.getBoundingClientRect().height > 0).length, selector);
  for (const [command, file] of Object.entries(pages)) {
    const {page, troubles, close} = await open(browser, at(file), {width: 794, scheme: 'dark'});
    assert.equal(await shown(page, '.still'), 0, 'on the screen the script draws');
    await page.emulateMedia({media: 'print', colorScheme: 'dark'});
    await settled(page);
    assert.equal(await shown(page, '.explore, .controls'), 0);
    if (command !== 'plan') assert.ok(await shown(page, '.still svg') >= 9, `${command}: drawings for paper`);
    await expectToFit(page, `${command} on paper`);
    const seen = await picture(page);
    assert.ok(seen.filled > 2000);
    const paper = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    assert.equal(paper, 'rgb(255, 255, 255)');
    assert.ok((await page.pdf({path: at(`${command}.pdf`), format: 'A4'})).length > 20000);
    assert.deepEqual(troubles, []);
    await close();
  }
});

/** Pictures of a PDF, as they were compressed: that of the arm is the largest. */
function imagesOf(pdf) {
  const text = pdf.toString('latin1');
  return [...text.matchAll(/\/Subtype ?\/Image\b[^]{0,300}?>> ?stream\r?\n([^]*?)\r?\nendstream/g)].map((m) => m[1])
    .sort((a, b) => b.length - a.length);
}

test('from a dark screen onto white paper', async () => {
  // Nothing is told to the page but that it is printed.
  const printed = async (scheme) => {
    const {page, troubles, close} = await open(browser, at(pages.identify), {width: 500, scheme});
    const {sum} = await picture(page);
    const images = imagesOf(await page.pdf({path: at(`from_${scheme}.pdf`), format: 'A4'}));
    await settled(page);
    assert.equal((await picture(page)).sum, sum, 'and back');
    assert.deepEqual(troubles, []);
    await close();
    return {sum, images};
  };
  const [light, dark] = [await printed('light'), await printed('dark')];
  assert.notEqual(dark.sum, light.sum);
  assert.ok(light.images.length > 0 && light.images[0].length > 5000, `${light.images.map((i) => i.length)}`);
  assert.deepEqual(dark.images.map((i) => i.length), light.images.map((i) => i.length));
  assert.ok(dark.images[0] === light.images[0], 'another picture of the arm');
});

test('without scripts everything but the 3-D view is there', async () => {
  for (const [command, file] of Object.entries(pages)) {
    const {page, close} = await open(browser, at(file), {width: 390, scripts: false});
    const main = page.locator('main');
    assert.match(await main.innerText(), /The view of the arm in 3-D needs scripts/);
    assert.ok(await page.locator('svg:visible').count() >= (command === 'plan' ? 2 : 9), command);
    await page.screenshot({path: at(`${command}_no_scripts.png`), fullPage: true});
    await close();
  }
});

test('without WebGL a sentence stands there, and the plots work', async () => {
  const blind = await launch({webgl: false});
  try {
    const {page, troubles, close} = await open(blind, at(pages.identify));
    assert.match(await page.innerText('.view3d'), /draws no 3-D here/);
    assert.equal(await page.locator('.stage').count(), 0);
    assert.equal(await marks(page, '.scatter'), 120);
    const plot = await page.locator('.scatter .frame').boundingBox();
    assert.doesNotMatch(await page.textContent('.explore .readout'), /the arm/);
    await page.mouse.click(plot.x + plot.width / 2, plot.y + plot.height / 2);
    await page.focus('.scatter');
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('Enter');
    assert.equal(await page.locator('.ring.chosen:visible').count(), 2);
    assert.deepEqual(troubles.filter((t) => !/WebGL/i.test(t)), []);
    await close();
  } finally {
    await blind.close();
  }
});

test('three thousand poses stay below the limit, and more do too', async () => {
  for (const poses of [3000, 12000]) {
    simulate('many.csv', '--truth', truth, '--poses', String(poses), '--seed', '5', ...context);
    flexcomp('validate', '--robot', robot, '--calibration', 'cal.yaml', '--data', 'many.csv', '--report', 'many.html');
    assert.ok(statSync(at('many.html')).size <= largestPage, `${statSync(at('many.html')).size} bytes`);
    const {sets: [set]} = dataOf('many.html');
    assert.equal(set.total, poses);
    assert.ok(set.count === 3000 || (poses > 3000 && set.count >= 1000), `${set.count}`);
    for (const kind of ['size', 'x', 'turned']) {
      for (const {counts} of [set.histogram(kind, 'both', false), set.histogram(kind, 'after', false)]) {
        for (const list of Object.values(counts)) assert.equal(sumOf(list), poses);
      }
    }
    const {page, troubles, close} = await open(browser, at('many.html'), {width: 390});
    assert.ok((await picture(page)).near.before > 300);
    assert.equal(/of 12000 poses are drawn/.test(await page.innerText('main')), poses === 12000);
    assert.deepEqual(troubles, []);
    await close();
  }
});
