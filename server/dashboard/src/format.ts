// Numbers and times as people read them.

import type { Frame } from './api';

export function count(value: string | number | undefined): string {
    return Number(value ?? 0).toLocaleString('en-US');
}

/** "1.2 M": short, for axes and sums. */
export function compact(value: number): string {
    return value.toLocaleString('en-US', { notation: 'compact', maximumSignificantDigits: 3 }).replace('K', '\u00a0k').replace('M', '\u00a0M');
}

/** "mm", or empty if nobody said it. */
export function unitSign(frame: Frame | undefined): string {
    return { UNIT_MILLIMETER: 'mm', UNIT_CENTIMETER: 'cm', UNIT_METER: 'm' }[frame?.unit ?? ''] ?? '';
}

/** What lengths are in. */
export function lengthsIn(frame: Frame | undefined): string {
    return `lengths in ${unitSign(frame) || 'the unit of the file, which wasn’t said'}`;
}

/** "LPS", or empty if nobody said it. */
export function spaceName(frame: Frame | undefined): string {
    return frame?.space?.startsWith('SPACE_') ? word(frame.space).toUpperCase() : '';
}

/** Where the axes point to. */
export function axisNames(frame: Frame | undefined): [string, string, string] {
    const space = spaceName(frame);
    return space === 'LPS'
        ? ['x, to the left', 'y, to the back', 'z, to the head']
        : space === 'RAS'
          ? ['x, to the right', 'y, to the front', 'z, to the head']
          : ['x', 'y', 'z'];
}

const minus = (text: string) => text.replace('-', '−');

/** About three digits that mean something. */
export function number(value: number | undefined, digits = 3): string {
    if (value === undefined || !Number.isFinite(value)) {
        return '–';
    }
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e7)) {
        const [mantissa, power] = value.toExponential(digits - 1).split('e');
        return `${minus(mantissa!)} × 10${superscript(Number(power))}`;
    }
    return minus(value.toLocaleString('en-US', size >= 1000 ? { maximumFractionDigits: 0 } : { maximumSignificantDigits: digits }));
}

/** A measure in [0, 1], its digits always as many: columns of them line up. */
export function ratio(value: number | undefined): string {
    if (value === undefined || !Number.isFinite(value)) {
        return '–';
    }
    return value !== 0 && Math.abs(value) < 5e-4 ? '< 0.001' : value.toFixed(3);
}

/** "-3" as "⁻³". */
export function superscript(value: number): string {
    return Array.from(String(value), (c) => (c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[Number(c)])).join('');
}

/** As a sentence; a name that it begins with stays as it is. */
export function sentence(text: string): string {
    return /^\w*_/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1);
}

export function percent(value: number | undefined, digits = 1): string {
    return value === undefined ? '–' : `${minus((100 * value).toFixed(digits))} %`;
}

export function bytes(value: string | number | undefined): string {
    let size = Number(value ?? 0);
    const units = ['B', 'kB', 'MB', 'GB'];
    let unit = 0;
    while (size >= 1000 && unit < units.length - 1) {
        size /= 1000;
        ++unit;
    }
    return `${unit === 0 || size >= 100 ? Math.round(size) : size.toFixed(1)} ${units[unit]}`;
}

export function duration(seconds: number): string {
    if (!Number.isFinite(seconds) || seconds < 0) {
        return '–';
    }
    if (seconds < 0.095) {
        return `${Math.round(100 * seconds) * 10} ms`;
    }
    if (seconds < 10) {
        return `${seconds.toFixed(1)} s`;
    }
    if (seconds < 100) {
        return `${Math.round(seconds)} s`;
    }
    const minutes = Math.floor(seconds / 60);
    if (minutes < 60) {
        return `${minutes} min ${Math.round(seconds % 60)} s`;
    }
    return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** A guess, no more exact than guesses are. */
export function roughly(seconds: number): string {
    if (!Number.isFinite(seconds)) {
        return '–';
    }
    if (seconds < 8) {
        return 'a few seconds';
    }
    if (seconds < 55) {
        return `about ${10 * Math.max(1, Math.round(seconds / 10))} s`;
    }
    if (seconds < 3300) {
        return `about ${Math.round(seconds / 60)} min`;
    }
    return `about ${(seconds / 3600).toFixed(1)} h`;
}

/** "3 min". */
export function brief(seconds: number): string {
    if (seconds < 60) {
        return `${Math.round(Math.max(0, seconds))} s`;
    }
    return seconds < 3600 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

export function ago(time: string, now: number): string {
    const seconds = Math.max(0, (now - Date.parse(time)) / 1000);
    if (seconds < 5) {
        return 'just now';
    }
    return seconds < 86_400 ? `${brief(seconds)} ago` : moment(time).slice(0, 10);
}

/** "2026-03-01 14:05:09", local, for people of all countries. */
export function moment(time: string): string {
    const at = new Date(time);
    const two = (value: number) => String(value).padStart(2, '0');
    return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())} ${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}`;
}

/** "STATE_SUCCEEDED" as "succeeded". */
export function word(enumerator: string | undefined): string {
    return (enumerator ?? '')
        .replace(/^(STATE|STAGE|KIND|FORMAT|UNIT|SPACE)_/, '')
        .toLowerCase()
        .replaceAll('_', ' ');
}

export function fileName(job: { spec: { input: { file_name?: string } } }): string {
    return job.spec.input.file_name || 'unnamed surface';
}
