// Light, dark, or as the system says.

export type Theme = 'auto' | 'light' | 'dark';

const key = 'remesh-theme';
const listeners = new Set<() => void>();
const systemIsDark = matchMedia('(prefers-color-scheme: dark)');

export function theme(): Theme {
    const stored = localStorage.getItem(key);
    return stored === 'light' || stored === 'dark' ? stored : 'auto';
}

export function setTheme(next: Theme) {
    localStorage.setItem(key, next);
    apply();
}

/** Calls back whenever colours change. \return how to stop that */
export function onThemeChange(listener: () => void): () => void {
    listeners.add(listener);
    return () => listeners.delete(listener);
}

/** A colour of the style sheet, for what is drawn rather than styled. */
export function colour(name: string): string {
    return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

export function apply() {
    const choice = theme();
    const isDark = choice === 'dark' || (choice === 'auto' && systemIsDark.matches);
    document.documentElement.dataset.theme = isDark ? 'dark' : 'light';
    for (const listener of listeners) {
        listener();
    }
}

systemIsDark.addEventListener('change', apply);
