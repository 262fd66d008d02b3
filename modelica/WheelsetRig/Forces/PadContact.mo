within WheelsetRig.Forces;
model PadContact "Friction between the pads of one brake unit and its disc"
  extends Interfaces.PartialForce;
  parameter Real side(unit="1") "1: pads behind the axle, where the disc moves up; -1: in front";
  parameter Units.Length rB "Radius at which the pads act";
  parameter Units.Velocity vSmooth(min=1e-9) "Sliding velocity below which friction is smoothed";
  input Units.FrictionCoefficient mu "Friction coefficient";
  input Units.Force Fperp "Normal force, sum of both pads";
  Interfaces.Flange disc "Rotation of the disc"
    annotation (Placement(transformation(extent={{-10,-110},{10,-90}})));
  Units.Velocity vSlide "Velocity of the disc relative to the pads, upwards";
  Units.Force F "Friction force on the pads, upwards";
protected
  Units.Length e "Displacement of the pads relative to the disc's centre, upwards";
equation
  e = frame_b.r_0[3] - frame_a.r_0[3];
  vSlide = side*rB*der(disc.phi) - der(e);
  F = mu*Fperp*tanh(vSlide/vSmooth);
  frame_b.f = {0.0, 0.0, -F};
  frame_b.t = zeros(3);
  disc.tau = side*rB*F;
  energy = 0.0;
  lossPower = F*vSlide;
  annotation (Documentation(info="<html>
<p><code>frame_a</code> is the centre of the disc on the axle, <code>frame_b</code> the pads. The
force on the disc acts at the pads: as force at the disc's centre and as torque on
<code>disc</code>.</p>
<h4>Limits</h4>
<p>The pads slide vertically. No stiction: below <code>vSmooth</code> the disc creeps.</p>
</html>"));
end PadContact;
