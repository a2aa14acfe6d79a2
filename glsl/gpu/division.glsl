// Of every kernel: whether the device's own division is correctly rounded (src/gpu/context.rs).
#ifndef HEDGEROW_GPU_DIVISION
#define HEDGEROW_GPU_DIVISION
layout(constant_id = 29) const bool DIVISION_IS_EXACT = false;
#define HEDGEROW_DIVISION_IS_EXACT DIVISION_IS_EXACT
#endif
