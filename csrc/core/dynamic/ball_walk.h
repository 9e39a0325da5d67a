/* SPDX-License-Identifier: BSD-3-Clause */
/* ball_walk.h: the entries in the cells that a ball meets. */
#ifndef HS_BALL_WALK_H
#define HS_BALL_WALK_H

#include "ball.h"

/* Entries within the ball, in each image; whether it was left early. */
bool hs_ball_within(hs_ball *ball, const hs_ball_visit *visit);

/* Entries of all these cells, each once. The spans of the ball may be cut. */
void hs_ball_near(hs_ball *ball, const hs_ball_visit *visit);

#endif
