  function branchy
    input Real e[3]; input Real k; output Real f[3]; output Real n;
  protected
    Real s;
  algorithm
    s := 0.0;
    for i in 1:3 loop s := s + e[i]^2; end for;
    n := sqrt(s);
    if k > 1.0 then f := k*e/n; elseif k < -1.0 then f := -e; else f := e; end if;
  end branchy;
  model M
    final parameter Integer n = 3;
    parameter Real k = 2.0;
    parameter Real twice = 2*k;
    input Real u;
    Real r[3](start={1.0, 2.0, 3.0}*k, each fixed=true);
    Real A[3,3] = identity(3)*1.0 + [1.0,2.0,3.0; 4.0,5.0,6.0; 7.0,8.0,9.0];
    Real z[3]; Real length;
    output Real y1 = A[1,:]*r + sum(r[2:n]) + time + r*r;
    output Real y2 = min(r) + max(r[1], u) + twice + atan2(r[1], 2.0) + noEvent(abs(u));
    output Real y3[3] = cross(r, {1.0, 0.0, u}) + transpose(A)*r
      + (if noEvent(u > 0) then r else -r);
    output Real y4 = z[2] + length;
  equation
    (z, length) = branchy(r, k);
    for i in 1:3 loop der(r[i]) = -i*r[i] + u; end for;
  end M;
