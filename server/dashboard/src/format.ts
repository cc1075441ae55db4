// Numbers and times as people read them.

export function count(value: string | number | undefined): string {
    return Number(value ?? 0).toLocaleString('en-US');
}

/** About three digits that mean something. */
export function number(value: number | undefined, digits = 3): string {
    if (value === undefined || !Number.isFinite(value)) {
        return '–';
    }
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e6)) {
        return value.toExponential(digits - 1);
    }
    return value.toLocaleString('en-US', { maximumSignificantDigits: Math.max(digits, size >= 1000 ? 6 : 0) });
}

export function percent(value: number | undefined, digits = 1): string {
    return value === undefined ? '–' : `${(100 * value).toFixed(digits)} %`;
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

export function ago(time: string, now: number): string {
    const seconds = Math.max(0, (now - Date.parse(time)) / 1000);
    if (seconds < 5) {
        return 'just now';
    }
    if (seconds < 60) {
        return `${Math.round(seconds)} s ago`;
    }
    if (seconds < 3600) {
        return `${Math.round(seconds / 60)} min ago`;
    }
    if (seconds < 86_400) {
        return `${Math.round(seconds / 3600)} h ago`;
    }
    return new Date(time).toLocaleDateString();
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
