// The program of a worker in a browser.
import { answer } from './answer.js';

addEventListener('message', (event) => answer(event.data, (message, list) => postMessage(message, list)));
