// The studio that a server gives: isoform studio.

import { server } from "./server";
import { start } from "./start";

start(server);
