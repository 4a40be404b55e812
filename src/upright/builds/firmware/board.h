/* What the example needs of a board. */
#ifndef BOARD_H
#define BOARD_H

void board_print(const char *text);

#endif
