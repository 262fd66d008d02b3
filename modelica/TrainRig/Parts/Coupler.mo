within TrainRig.Parts;
model Coupler "Spring and damper between two vehicles, with a gap"
  parameter Real c(unit="N/m", min=1.0) = 1.0e7 "Stiffness";
  parameter Real d(unit="N.s/m", min=0.0) = 1.0e5 "Damping, once the gap is taken up";
  parameter Real gap(unit="m", min=0.0) = 0.0 "Way on which nothing is felt";
  Flange front "At the vehicle in front";
  Flange rear "At the vehicle behind";
  Real s(unit="m", start=0.0, fixed=true, nominal=1e-2) "Elongation, from the middle of the gap";
  Real stretch(unit="m") "Elongation beyond the gap";
  Real F(unit="N") "Tension";
  Real energy(unit="J") "Energy stored";
  Real lossPower(unit="W") "Power turned into heat, never negative";
protected
  Real ds(unit="m/s") "Rate of s";
  Real damping(unit="N.s/m") "That acts";
equation
  der(s) = ds;
  ds = front.v - rear.v;
  stretch = noEvent(s - min(max(s, -0.5*gap), 0.5*gap));
  damping = noEvent(if abs(s) >= 0.5*gap then d else 0.0);
  F = c*stretch + damping*ds;
  front.f = F;
  rear.f = -F;
  energy = 0.5*c*stretch^2;
  lossPower = damping*ds^2;
  annotation (Documentation(info="<html>
<p><code>F = c*stretch + d*s'</code>; within the gap nothing. The elongation is a state of its own,
since as a difference of two ways it would lose the digits that its force is made of.</p>
<h4>Limitations</h4>
<p>The damper's force steps where the gap is taken up. No hysteresis and no stop at the end of the stroke.
Stiffness and damping are no vehicle's: vehicles of 50 t swing against each other at 3.2 Hz, with a
tenth of critical damping.</p>
<h4>References</h4>
<p>C. Cole, Longitudinal train dynamics, in: S. Iwnicki (ed., 2006), Handbook of Railway Vehicle
Dynamics, for vehicles as masses between couplers with slack.</p>
</html>"));
end Coupler;
