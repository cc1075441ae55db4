import type { ComponentChildren } from 'preact';
import { useEffect, useState } from 'preact/hooks';

import type { Capabilities } from '../api';
import { handOver } from '../dropped';
import { navigate } from '../router';
import { setTheme, theme, type Theme } from '../theme';

const themes: Theme[] = ['auto', 'light', 'dark'];
const themeLabels = { auto: 'Auto', light: 'Light', dark: 'Dark' };

/** What is around every page. Files dropped anywhere go to the form. */
export function Shell(props: {
    at: string;
    capabilities: Capabilities | null;
    /** Absent where there is no session to end. */
    onSignOut?: (() => void) | undefined;
    children: ComponentChildren;
}) {
    const isDragging = useFileDrop();
    return (
        <>
            <a class="skip" href="#main">
                Skip to content
            </a>
            <header class="top">
                <a class="brand" href="/" aria-label="remesh, queue">
                    <Mark />
                    <span>remesh</span>
                </a>
                <nav aria-label="Pages">
                    <a href="/" aria-current={props.at === '/' ? 'page' : undefined}>
                        Queue
                    </a>
                    <a href="/new" aria-current={props.at === '/new' ? 'page' : undefined}>
                        New job
                    </a>
                </nav>
                <div class="top-end">
                    <ThemePicker />
                    {props.onSignOut && (
                        <button class="quiet" onClick={props.onSignOut}>
                            Sign out
                        </button>
                    )}
                </div>
            </header>
            <main id="main" tabIndex={-1}>
                {props.children}
            </main>
            <footer>
                {props.capabilities ? `remeshd ${props.capabilities.server_version}` : 'remeshd'}
                <span aria-hidden="true"> · </span>
                <a href="/metrics" target="_blank" rel="noreferrer">
                    metrics
                </a>
            </footer>
            {isDragging && (
                <div class="drop-veil" aria-hidden="true">
                    <p>Drop surfaces to remesh them</p>
                </div>
            )}
        </>
    );
}

function Mark() {
    return (
        <svg class="mark" viewBox="0 0 32 32" aria-hidden="true">
            <path d="M16 3 29 26H3z" />
            <path class="lines" d="M16 3 18.5 18 29 26M18.5 18 3 26" />
        </svg>
    );
}

function ThemePicker() {
    const [choice, setChoice] = useState(theme());
    return (
        <label class="theme">
            <span class="sr">Colours</span>
            <select
                value={choice}
                onChange={(event) => {
                    const next = event.currentTarget.value as Theme;
                    setChoice(next);
                    setTheme(next);
                }}
            >
                {themes.map((name) => (
                    <option key={name} value={name}>
                        {themeLabels[name]}
                    </option>
                ))}
            </select>
        </label>
    );
}

function useFileDrop(): boolean {
    const [isDragging, setDragging] = useState(false);
    useEffect(() => {
        let depth = 0;
        const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes('Files') ?? false;
        const enter = (event: DragEvent) => {
            if (hasFiles(event)) {
                event.preventDefault();
                ++depth;
                setDragging(true);
            }
        };
        const over = (event: DragEvent) => {
            if (hasFiles(event)) {
                event.preventDefault();
            }
        };
        const leave = () => {
            depth = Math.max(0, depth - 1);
            setDragging(depth > 0);
        };
        const drop = (event: DragEvent) => {
            if (hasFiles(event)) {
                event.preventDefault();
                depth = 0;
                setDragging(false);
                handOver([...event.dataTransfer!.files]);
                navigate('/new');
            }
        };
        const handlers = { dragenter: enter, dragover: over, dragleave: leave, drop } as const;
        for (const [name, handler] of Object.entries(handlers)) {
            addEventListener(name, handler as EventListener);
        }
        return () => {
            for (const [name, handler] of Object.entries(handlers)) {
                removeEventListener(name, handler as EventListener);
            }
        };
    }, []);
    return isDragging;
}
