// SPDX-License-Identifier: GPL-3.0-or-later
// Shows how a device rounds; Device::check_arithmetic says what it must come to.

kernel void check_arithmetic(float a, float c, float tiny, double da, double dc,
                             global float* floats, global double* doubles) {
    floats[0] = a * a + c;
    floats[1] = tiny * 0.5F;
    floats[2] = divide(1.0F, a);
    floats[3] = (float)((double)0x1p-149F * 2.0) + 0x1p-149F;
    doubles[0] = da * da + dc;
    doubles[1] = fma(da, da, dc);
    doubles[2] = da / 3.0;
    doubles[3] = 0x1p-1074 + 0x1p-1074;
}
