/* The programs of a firmware: the scan of the build, and its central half; and the sequencer that plays them. */
#ifndef SCAN_H
#define SCAN_H

#include "dac_sequencer.h"

#ifdef __cplusplus
extern "C" {
#endif

extern dac_sequencer sequencer; /* in the port */

extern const dac_converter scan_x_converter, scan_y_converter;
#if DAC_SLOW_PART
#include "names.h"
#define scan_whole NAMED(_program) /* of NAME_program.c, which has the slow part of a scan at an angle */
#endif
extern const dac_program scan_whole;
#if DAC_LINK_Z
#define scan_z NAMED(_z_program) /* of NAME_z_program.c */
extern const dac_program scan_z;
extern const dac_converter scan_z_converter, scan_z_rest_converter;
extern dac_sequencer sequencer_of_z; /* in the port */
#endif

/* The half scan. Its tables are computed here from Fourier words, into one of two places: see dac_sequencer_idle().
 * Returns false if the build has no such words, as that of a scan at an angle. */
bool scan_half(dac_program *program, unsigned place);

#ifdef __cplusplus
}
#endif

#endif
