package PositioningStage "A carriage on a ball screw that a motor drives, under position control"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>A motor drives a carriage by a ball screw; two nested loops control its position by the motor's
encoder, a thousand times a second. The machine of A. Janot, M. Gautier, M. Brunot, <em>Data Set and
Reference Models of EMPS</em>, Workshop on Nonlinear System Identification Benchmarks, Eindhoven
(2019).</p>
<h4>Closed loop</h4>
<p>Force to position is an integrator, of which a free run drifts off. The controller is known and
part of the model, so that a free run has the reference as its input, and the command is an output
beside the position: what the model lacks shows in the command, since control hides it in the
position.</p>
</html>"));
end PositioningStage;
