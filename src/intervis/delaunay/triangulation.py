import numpy as np
from intervis.delaunay.order import spatial_order
from intervis.delaunay.divide import divide
from intervis.delaunay.half_edges import mark_outside, write_half_edges
def triangulate(positions):
    n=len(positions)
    xy=np.empty(2*n); row=np.empty(n,np.int32); cut=np.empty(n,np.int16); vertex=np.empty(n,np.int32)
    m=spatial_order(positions,xy,row,cut,vertex)
    links=np.empty(24*m,np.int32)
    hull,unused,top=divide(links,xy,cut,0,m)
    links=links[:4*top]
    out=mark_outside(links,hull)
    e=(top - 2*count_free(links,unused))//2
    f=e-m+1
    start=np.empty(3*f,np.int32); opp=np.empty(3*f,np.int32)
    k=write_half_edges(links,row,start,opp)
    assert k==3*f,(k,f,out)
    return start,opp,out
def count_free(links,unused):
    return int((links[2::4].reshape(-1,2)[:,0]==-1).sum())
