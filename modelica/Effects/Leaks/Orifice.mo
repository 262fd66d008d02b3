within Effects.Leaks;
model Orifice "A leak through a sharp hole, choked at a critical ratio of pressures"
  extends Interfaces.Flow;
  parameter Real C(unit="m3/(s.Pa)", min=0.0) = 0.0 "Sonic conductance";
  parameter Real b(unit="1", min=0.0, max=0.9) = 0.5 "Critical ratio of pressures";
  parameter Units.Temperature T(min=1.0) = 293.15 "Temperature upstream";
  parameter Real rho0(unit="kg/m3", min=0.0) = 1.185 "Density at the reference: air, 1 bar, 20 degC";
  parameter Real smoothing(unit="1", min=1e-9) = 1e-3
    "Below this, what is left of the subsonic term is made linear";
protected
  Units.Pressure pHigh "The higher pressure";
  Real subsonic(unit="1") "Part of the range of ratios above the critical one";
  Real term(unit="1") "Square of the flow, as part of the choked one";
equation
  pHigh = noEvent(max(p1, p2));
  subsonic = noEvent(max(0.0, min(p1, p2)/pHigh - b))/(1.0 - b);
  term = 1.0 - subsonic^2;
  q = C*rho0*pHigh*sqrt(293.15/T)*term/sqrt(term + smoothing*(1.0 - term))
    *noEvent(if p1 < p2 then -1.0 else 1.0);
  annotation (Documentation(info="<html>
<p><code>q = C*rho0*p1*sqrt(T0/T)*psi</code>, <code>psi = 1</code> where <code>p2/p1</code> is below
the critical ratio b (choked flow), else <code>psi = sqrt(1 - ((p2/p1 - b)/(1 - b))^2)</code>; T0 is
293.15 K. For air an effective area of 1 mm2 has C = 2e-9 m3/(s.Pa); b is 0.528 in an ideal nozzle,
0.2 to 0.5 in valves.</p>
<h4>Limits</h4>
<p>The slope of psi is infinite at equal pressures: there <code>term/sqrt(term + smoothing*(1 -
term))</code> stands for <code>sqrt(term)</code>, off by <code>smoothing/(2*term)</code> at most.
The temperature does not change.</p>
<h4>References</h4>
<p>ISO 6358-1:2013, <em>Pneumatic fluid power: determination of flow-rate characteristics of
components using compressible fluids</em>.</p>
</html>"));
end Orifice;
