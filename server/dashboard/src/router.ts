// Addresses inside the page, kept by the browser's own history.

const listeners = new Set<() => void>();

export function path(): string {
    return location.pathname;
}

/** Where a job is shown. */
export function jobPath(name: string): string {
    const [, tenant, , id] = name.split('/');
    return `/jobs/${tenant}/${id}`;
}

export function navigate(to: string) {
    history.pushState(null, '', to);
    scrollTo(0, 0);
    notify();
    // A screen reader is told of the new page by its heading.
    requestAnimationFrame(() => document.querySelector<HTMLElement>('h1')?.focus());
}

export function onNavigate(listener: () => void): () => void {
    listeners.add(listener);
    return () => listeners.delete(listener);
}

function notify() {
    for (const listener of listeners) {
        listener();
    }
}

addEventListener('popstate', notify);

addEventListener('click', (event) => {
    const link = (event.target as Element | null)?.closest?.('a');
    const isPlain = event.button === 0 && !event.metaKey && !event.ctrlKey && !event.shiftKey;
    if (link && isPlain && link.origin === location.origin && !link.target && !link.hasAttribute('download')) {
        if (!link.pathname.startsWith('/api/') && link.pathname !== '/metrics') {
            event.preventDefault();
            if (link.hash) {
                document.querySelector(link.hash)?.scrollIntoView();
            } else {
                navigate(link.pathname);
            }
        }
    }
});
