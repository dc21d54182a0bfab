// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The ground station's HTTP API as telemetry of Open MCT: a folder for each structure, a point for each parameter.

function SrfsPlugin() {
  const NAMESPACE = 'srfs';
  const ROOT = 'spacecraft';
  const api = (path) =>
    fetch('/api/v1/' + path).then((response) =>
      response.ok ? response.json() : response.json().then((body) => Promise.reject(new Error(body.error)))
    );
  let dictionary;
  const structures = () => {
    dictionary ??= api('dictionary').then((all) => all.structures.filter((one) => one.kind === 'housekeeping'));
    return dictionary;
  };

  const identifier = (key) => ({ namespace: NAMESPACE, key });

  // "eps_power" is a structure, "eps_power.battery_v" a parameter.
  function pointOf(structure, parameter) {
    const values = [
      { key: 'utc', source: 'timestamp', name: 'Time', format: 'utc', hints: { domain: 1 } },
      { key: 'value', name: parameter.name, unit: parameter.unit, hints: { range: 1 } },
    ];
    if (parameter.enum) {
      values[1].format = 'enum';
      values[1].enumerations = Object.entries(parameter.enum).map(([string, value]) => ({ string, value }));
    }
    return {
      identifier: identifier(`${structure.name}.${parameter.name}`),
      type: 'srfs.parameter',
      name: parameter.name,
      notes: parameter.description,
      location: `${NAMESPACE}:${structure.name}`,
      telemetry: { values },
      limits: parameter.limits ?? {},
      labels: parameter.enum ?? {},
    };
  }

  async function objectOf({ key }) {
    if (key === ROOT) return { identifier: identifier(ROOT), name: 'Spacecraft', type: 'folder', location: 'ROOT' };
    for (const structure of await structures()) {
      if (structure.name === key)
        return { identifier: identifier(key), name: key, type: 'folder', location: `${NAMESPACE}:${ROOT}` };
      if (!key.startsWith(structure.name + '.')) continue;
      const parameter = structure.parameters.find((one) => `${structure.name}.${one.name}` === key);
      if (parameter) return pointOf(structure, parameter);
    }
    throw new Error(`no parameter is called ${key}`);
  }

  const composition = {
    appliesTo: (object) => object.identifier.namespace === NAMESPACE && object.type === 'folder',
    async load(object) {
      const all = await structures();
      if (object.identifier.key === ROOT) return all.map((structure) => identifier(structure.name));
      const structure = all.find((one) => one.name === object.identifier.key);
      return structure.parameters.map((one) => identifier(`${structure.name}.${one.name}`));
    },
  };

  const isPoint = (object) => object.type === 'srfs.parameter';

  const history = {
    supportsRequest: isPoint,
    async request(object, options) {
      const query = new URLSearchParams({
        parameter: object.identifier.key,
        from: new Date(options.start).toISOString(),
        to: new Date(options.end).toISOString(),
        points: Math.min(options.size ?? 2000, 20000),
      });
      const { points } = await api('history?' + query);
      const all = points.map((point) => ({ timestamp: Date.parse(point.time), value: point.value ?? point.mean }));
      return options.strategy === 'latest' ? all.slice(-1) : all;
    },
  };

  // One stream for all points; the browser connects it again by itself, and goes on where it was.
  const listeners = new Map();
  let stream;
  function onPacket(message) {
    const packet = JSON.parse(message.data);
    if (packet.vc !== 0 || !packet.structure) return;
    for (const [name, raw] of Object.entries(packet.fields ?? {})) {
      for (const { object, callback } of listeners.get(`${packet.structure}.${name}`) ?? []) {
        const value = object.labels[raw] ?? raw;
        if (value !== null) callback({ timestamp: Date.parse(packet.time), value });
      }
    }
  }
  const live = {
    supportsSubscribe: isPoint,
    subscribe(object, callback) {
      if (!stream) {
        stream = new EventSource('/api/v1/stream');
        stream.addEventListener('tm_packet', onPacket);
        stream.addEventListener('beacon', onPacket);
      }
      const key = object.identifier.key;
      const entry = { object, callback };
      listeners.set(key, (listeners.get(key) ?? new Set()).add(entry));
      return () => listeners.get(key).delete(entry);
    },
  };

  const limits = {
    supportsLimits: isPoint,
    getLimitEvaluator: (object) => ({
      evaluate(datum, metadata) {
        const { red_low, red_high, yellow_low, yellow_high } = object.limits;
        const value = datum[metadata?.key ?? 'value'];
        const state = (low, high, name, colour) => {
          if (value < low) return { cssClass: `is-limit--lwr is-limit--${colour}`, low: -Infinity, high: low, name };
          if (value > high) return { cssClass: `is-limit--upr is-limit--${colour}`, low: high, high: Infinity, name };
          return undefined;
        };
        return state(red_low, red_high, 'red', 'red') ?? state(yellow_low, yellow_high, 'yellow', 'yellow');
      },
    }),
  };

  return function install(openmct) {
    openmct.types.addType('srfs.parameter', { name: 'Parameter', cssClass: 'icon-telemetry' });
    openmct.objects.addRoot(identifier(ROOT));
    openmct.objects.addProvider(NAMESPACE, { get: objectOf });
    openmct.composition.addProvider(composition);
    openmct.telemetry.addProvider(history);
    openmct.telemetry.addProvider(live);
    openmct.telemetry.addProvider(limits);
  };
}
