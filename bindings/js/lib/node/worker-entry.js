// The program of a worker in Node.
import { parentPort } from 'node:worker_threads';
import './load.js';
import { answer } from '../answer.js';

parentPort.on('message', (message) => answer(message, (reply, list) => parentPort.postMessage(reply, list)));
