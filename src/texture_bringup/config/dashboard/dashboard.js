'use strict';

const RETRY_MS = 1000;
const SILENT_MS = 3000;
const FRAME_MS = 100;
const BARS = 8;
const ENDED = ['idle', 'done', 'aborted'];
const at = (id) => document.getElementById(id);
let replaying = null;
let last = 0;
let connected = false;

const shown = (value, digits, unit) => (value === null || value === undefined ? '–' : `${value.toFixed(digits)} ${unit}`);
const say = (text, bad = false) => {
  at('banner').textContent = text;
  at('banner').className = bad ? 'banner bad' : 'banner';
  at('banner').hidden = !text;
};
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);
const element = (kind, text, className = '') => {
  const made = document.createElement(kind);
  made.textContent = text;
  made.className = className;
  return made;
};

// Redraw a list only when what it shows has changed: a button under a finger must not vanish.
const fill = (parent, items, make) => {
  const key = JSON.stringify(items);
  if (parent.dataset.key === key) return;
  parent.dataset.key = key;
  parent.replaceChildren(...items.map(make));
};

const drawing = (id) => {
  const canvas = at(id);
  const scale = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = Number(canvas.dataset.height || (canvas.dataset.height = canvas.height));
  canvas.style.height = `${height}px`;
  if (canvas.width !== Math.round(width * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext('2d');
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.fillStyle = colour('--soft');
  pen.font = '12px system-ui, sans-serif';
  return { pen, width, height };
};

function drawSignal(signal) {
  const { pen, width, height } = drawing('signal');
  at('signal-name').textContent = signal.sensor ? `${signal.sensor} ${signal.channel}, ${signal.unit}, last ${signal.length_s} s` : 'no samples yet';
  const known = [...signal.low, ...signal.high].filter((value) => value !== null);
  if (!known.length) return;
  const low = Math.min(...known);
  const span = Math.max(...known) - low || 1;
  const y = (value) => height - 8 - ((value - low) / span) * (height - 16);
  pen.strokeStyle = colour('--accent');
  pen.lineWidth = Math.max(1, width / signal.low.length);
  pen.beginPath();
  signal.low.forEach((value, k) => {
    if (value === null) return;
    const x = ((k + 0.5) / signal.low.length) * width;
    pen.moveTo(x, y(value) + 0.5);
    pen.lineTo(x, y(signal.high[k]) - 0.5);
  });
  pen.stroke();
  pen.fillText((low + span).toPrecision(4), 2, 12);
  pen.fillText(low.toPrecision(4), 2, height - 2);
}

function drawSpectrum(spectrum) {
  const { pen, width, height } = drawing('spectrum');
  at('spectrum-name').textContent = spectrum.db.length ? `0 to ${spectrum.high_hz} Hz, dB` : '';
  if (!spectrum.db.length) return;
  const base = height - 16;
  const high = Math.max(...spectrum.db, -20);
  const low = high - 70;
  const step = width / spectrum.db.length;
  pen.fillStyle = colour('--accent');
  spectrum.db.forEach((value, k) => {
    const tall = Math.max(0, ((value - low) / (high - low)) * base);
    pen.fillRect(k * step, base - tall, Math.max(1, step - 1), tall);
  });
  pen.fillStyle = colour('--soft');
  [0, 0.25, 0.5, 0.75, 1].forEach((share) => {
    pen.textAlign = share === 0 ? 'left' : share === 1 ? 'right' : 'center';
    pen.fillText(`${Math.round(share * spectrum.high_hz)}`, share * width, height - 3);
  });
  pen.textAlign = 'left';
}

function drawTaxels(taxels) {
  const { pen, width, height } = drawing('taxels');
  const { values, places, unit } = taxels;
  if (!values.length) {
    at('taxel-range').textContent = 'this sensor has none';
    return;
  }
  const most = Math.max(1e-9, ...values.map((value) => Math.abs(value ?? 0)));
  at('taxel-range').textContent = `from rest, ±${most.toPrecision(3)} ${unit}`;
  const rows = 1 + Math.max(...places.map((place) => place[0]));
  const columns = 1 + Math.max(...places.map((place) => place[1]));
  const side = Math.min(width / columns, height / rows);
  const left = (width - side * columns) / 2;
  values.forEach((value, k) => {
    const share = Math.abs(value ?? 0) / most;
    pen.fillStyle = value === null ? colour('--line') : `color-mix(in srgb, ${value < 0 ? '#e8590c' : '#1098ad'} ${Math.round(100 * share)}%, ${colour('--back')})`;
    pen.fillRect(left + places[k][1] * side, places[k][0] * side, side - 2, side - 2);
  });
}

function showState(state) {
  at('phase').textContent = state.phase;
  at('phase').className = `phase ${ENDED.includes(state.phase) ? state.phase : 'moving'}`;
  at('progress').value = state.progress ?? 0;
  at('speed').textContent = shown(state.speed_m_s, 3, 'm/s');
  at('force').textContent = shown(state.force_n, 2, 'N');
  at('motion-now').textContent = state.motion || '–';
}

function showTexture(texture) {
  at('label').textContent = texture.label ? (texture.known ? texture.label : `${texture.label}?`) : '–';
  at('label').dataset.final = texture.final;
  const seen = texture.windows ? `${texture.windows} windows, ${texture.evidence_s.toFixed(1)} s` : '';
  const sure = texture.label && texture.confidence !== null ? `confidence ${texture.confidence.toFixed(2)}` : '';
  const strange = texture.label && !texture.known ? 'resembles none of the known textures' : '';
  at('estimate-note').textContent = [sure, seen, strange, texture.message].filter(Boolean).join(' · ');
  const bars = texture.labels.slice(0, BARS).map((label, k) => [label, texture.probabilities[k]]);
  fill(at('evidence'), bars, ([label, probability]) => {
    const bar = element('div', '', 'bar');
    const meter = document.createElement('meter');
    meter.value = probability;
    bar.append(element('span', label), meter, element('span', probability.toFixed(2)));
    return bar;
  });
}

function showRoughness(roughness) {
  const share = roughness.valid ? Math.min(1, Math.max(0, (roughness.grade - 1) / 4)) : 0;
  at('gauge-arc').style.strokeDasharray = `${100 * share} 100`;
  at('grade').textContent = roughness.valid ? roughness.grade.toFixed(1) : '–';
  at('roughness-note').textContent = roughness.valid ? `± ${roughness.grade_std === null ? '?' : roughness.grade_std.toFixed(1)}` : roughness.message;
}

function showFrame(frame) {
  drawSignal(frame.signal);
  drawSpectrum(frame.spectrum);
  drawTaxels(frame.taxels);
  showState(frame.state);
  showTexture(frame.texture);
  showRoughness(frame.roughness);
}

function showRest(frame) {
  fill(at('lights'), frame.lights, (light) => element('li', `${light.name}: ${light.message}`, light.colour));
  at('record').textContent = frame.recording ? 'End recording' : 'Record';
  at('record').dataset.on = frame.recording ? 'yes' : '';
  at('recording').textContent = frame.recording;
  const past = frame.past.map(({ id, motion, phase, label, grade, surface }) => ({ id, motion, phase, label, grade, surface }));
  fill(at('past'), past, (item) => {
    const row = element('li', '');
    const grade = item.grade === null || item.grade === undefined ? '' : `roughness ${item.grade.toFixed(1)}`;
    const truth = item.surface ? `(over ${item.surface})` : '';
    const button = element('button', 'Replay');
    button.addEventListener('click', () => replay(item.id));
    row.append(element('span', [item.motion, item.phase, item.label || 'no label', truth, grade, item.id].filter(Boolean).join(' · ')), button);
    return row;
  });
}

async function replay(id) {
  const answer = await fetch(`api/past/${encodeURIComponent(id)}`).catch(() => null);
  if (!answer || !answer.ok) {
    say('this exploration is no longer kept', true);
    return;
  }
  const { stride, frames } = await answer.json();
  window.clearInterval(replaying);
  let k = 0;
  say(`replaying ${id}`);
  window.scrollTo({ top: 0, behavior: 'smooth' });
  replaying = window.setInterval(() => {
    if (k < frames.length) {
      showFrame(frames[k]);
      k += 1;
      return;
    }
    window.clearInterval(replaying);
    replaying = null;
    say(`replayed ${id}`);
  }, FRAME_MS * stride);
}

async function ask(name, body) {
  try {
    const answer = await fetch(`api/${name}`, {
      method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body),
    });
    const told = await answer.json();
    say(told.message, !told.success);
  } catch (error) {
    say(`'${name}' was not answered: ${error.message}`, true);
  }
}

async function loadMotions() {
  const motions = await (await fetch('api/motions')).json();
  const chosen = at('motion').value;
  at('motion').replaceChildren(...Object.keys(motions).map((name) => element('option', name)));
  at('motion').value = chosen in motions ? chosen : Object.keys(motions)[0];
  const offer = () => at('numbers').replaceChildren(...motions[at('motion').value].map(numberField));
  at('motion').onchange = offer;
  offer();
}

function numberField(number) {
  const label = element('label', `${[...new Set([number.name.split('_')[0], number.unit])].join(', ')} (${number.low} to ${number.high})`);
  const input = document.createElement('input');
  Object.assign(input, { type: 'number', step: 'any', min: number.low, max: number.high, value: number.default, required: true, name: number.name });
  label.append(input);
  return label;
}

function connect() {
  const socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws`);
  socket.onopen = () => {
    connected = true;
    last = Date.now();
    say('');
    loadMotions().catch(() => say('the list of motions did not come; load the page again', true));
  };
  socket.onmessage = (message) => {
    const frame = JSON.parse(message.data);
    last = Date.now();
    if (replaying === null) showFrame(frame);
    showRest(frame);
  };
  socket.onclose = () => {
    connected = false;
    at('phase').textContent = 'not connected';
    at('phase').className = 'phase aborted';
    window.setTimeout(connect, RETRY_MS);
  };
}

at('explore').addEventListener('submit', (event) => {
  event.preventDefault();
  const numbers = [...at('numbers').querySelectorAll('input')].map((input) => [input.name, Number(input.value)]);
  window.clearInterval(replaying);
  replaying = null;
  say('exploring');
  ask('explore', {
    motion: at('motion').value, ...Object.fromEntries(numbers), direction_rad: Number(at('direction').value),
    surface: at('surface').value.trim(), early_stopping: at('certain').checked,
  });
});
at('learn').addEventListener('submit', (event) => {
  event.preventDefault();
  ask('learn', { label: at('texture').value.trim() });
});
at('stop').addEventListener('click', () => ask('stop', {}));
at('undo').addEventListener('click', () => ask('learn', { undo: true }));
at('record').addEventListener('click', () => ask('record', { on: !at('record').dataset.on }));
window.setInterval(() => {
  if (!connected || Date.now() - last > SILENT_MS) say('nothing comes from the dashboard; is it still running?', true);
}, SILENT_MS);
connect();
