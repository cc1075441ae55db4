// Files on their way from where they were dropped to the form.

let files: File[] = [];
const listeners = new Set<(files: File[]) => void>();

export function handOver(dropped: File[]) {
    if (listeners.size > 0) {
        for (const listener of listeners) {
            listener(dropped);
        }
    } else {
        files = dropped;
    }
}

/** Takes what was dropped before and is called for what comes. \return how to stop that */
export function receive(listener: (files: File[]) => void): () => void {
    listeners.add(listener);
    if (files.length > 0) {
        listener(files);
        files = [];
    }
    return () => listeners.delete(listener);
}
