//! Tables, charts and the HTML page: figures as a reader wants them.
