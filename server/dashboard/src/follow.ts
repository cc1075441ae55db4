// Server-sent events that survive: a hidden tab lets go of its connection (a browser has six for a
// host), and a server that was away is asked again. Both go on after the last event seen.

export type Link = 'connecting' | 'live' | 'lost' | 'over';

interface Options {
    /** Address of the stream; `after` is the id of the last event seen, empty at first. */
    url: (after: string) => string;
    events: Record<string, (data: string) => void>;
    onLink: (link: Link) => void;
    /** The server refuses the stream, e.g. because the job is gone. */
    onRefused?: (status: number) => void;
    /** Whether the stream has nothing more to tell. */
    isOver?: () => boolean;
}

const firstWait = 500;
const longestWait = 8_000;

/** Follows a stream until the function that is returned is called. */
export function follow(options: Options): () => void {
    let source: EventSource | null = null;
    let lastId = '';
    let wait = firstWait;
    let timer: ReturnType<typeof setTimeout> | undefined;
    let isStopped = false;

    const close = () => {
        clearTimeout(timer);
        source?.close();
        source = null;
    };

    const retry = async () => {
        close();
        if (isStopped || document.hidden) {
            return;
        }
        if (options.isOver?.()) {
            options.onLink('over');
            return;
        }
        options.onLink('lost');
        timer = setTimeout(open, wait);
        wait = Math.min(2 * wait, longestWait);
    };

    const open = () => {
        close();
        if (isStopped || document.hidden) {
            return;
        }
        source = new EventSource(options.url(lastId));
        source.onopen = () => {
            wait = firstWait;
            options.onLink('live');
        };
        for (const [name, handle] of Object.entries(options.events)) {
            source.addEventListener(name, (event) => {
                if (event.lastEventId) {
                    lastId = event.lastEventId;
                }
                handle(event.data);
            });
        }
        source.addEventListener('refused', (event) => {
            void refused(JSON.parse(event.data));
        });
        // EventSource would try again by itself, but not after a status; one way is enough.
        source.onerror = () => void probe();
    };

    const refused = async (_: unknown) => {
        close();
        await probe();
    };

    /** Why did it end? A refusal is told, a lost connection is mended. */
    const probe = async () => {
        close();
        if (options.isOver?.()) {
            options.onLink('over');
            return;
        }
        try {
            const abort = new AbortController();
            const response = await fetch(options.url(lastId), { signal: abort.signal });
            abort.abort();
            if (response.status >= 400 && response.status < 500 && response.status !== 429) {
                isStopped = true;
                options.onRefused?.(response.status);
                return;
            }
        } catch {
            // the server is away
        }
        await retry();
    };

    const onVisibility = () => {
        if (document.hidden) {
            close();
        } else if (!source && !options.isOver?.()) {
            open();
        }
    };

    document.addEventListener('visibilitychange', onVisibility);
    options.onLink('connecting');
    open();
    return () => {
        isStopped = true;
        document.removeEventListener('visibilitychange', onVisibility);
        close();
    };
}
