/* SPDX-License-Identifier: BSD-3-Clause */
/* support_along.h: how far a support reaches along a direction: less than a ball around it, where
 * it is narrow there. */
#ifndef HS_SUPPORT_ALONG_H
#define HS_SUPPORT_ALONG_H

/* Not below |normal . D| of any D within the support, and near to the most that it can be.
 * size: of hs_support_size; reach: of hs_support_reach. */
double hs_support_width(int ndim, const double *entries, double size, double extent, double reach,
                        const double *normal);

#endif
