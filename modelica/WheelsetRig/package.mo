package WheelsetRig "Longitudinal dynamics of a wheelset on a roller rig"
  import Common = Effects;

  annotation (
    version="0.1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>Models of a braked wheelset on a roller rig, after C. Schwarz, J. Brembeck, B. Heckmann (2018),
<em>Dynamics observer for the longitudinal behavior of a wheelset on a roller rig</em>.</p>
<h4>Signs</h4>
<p>x points forward, z up, y to the left; angular velocities are positive in forward rotation.
The slip velocity is <code>w = rR*omegaR - rW*omegaW</code>; braking gives <code>w &gt; 0</code>.
A creep force <code>Fx &gt; 0</code> is a braking force: it spins the wheelset up and slows the
roller. Angular velocities, drive torque and creep force change sign with the direction of
rotation, brake pressure and wheel load do not.</p>
<h4>Equations</h4>
<p>All right-hand sides are smooth or wrapped in <code>noEvent</code>: the models have no events,
so that an observer may set states, step and roll back at any time.</p>
</html>"));
end WheelsetRig;
