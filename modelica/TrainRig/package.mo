within ;
package TrainRig "A train that brakes: axles, bogies and vehicles, as its own sensors see it"
  import Common = Effects;
  import Rig = WheelsetRig;
  annotation (
    version="1.0",
    uses(Effects(version="1.0"), WheelsetRig(version="0.1.0")),
    Documentation(info="<html>
<p><code>Train</code> is the longitudinal dynamics of a train in service, with the contact law and the
axle losses of <code>WheelsetRig</code>; <code>TwoVehicles</code> names the signals of one of two vehicles.
<code>Reference</code> is more detailed: couplers, a rail that is cleaned, discs, slide protection.
<code>Effects</code> holds what it may lack. There are no load cells: a recording has cylinder pressures
of the bogies, speeds of the axles and an accelerometer.</p>
<h4>Signs</h4>
<p>Speeds are positive forward. A creep force <code>Fx &gt; 0</code> brakes the train. Gradients are
positive uphill.</p>
<h4>Numbers</h4>
<p>Axles, bogies and vehicles count from the front, in the direction of travel: bogie <code>j</code>
carries axles <code>2j-1</code> and <code>2j</code>, vehicle <code>k</code> bogies <code>2k-1</code> and
<code>2k</code>.</p>
</html>"));
end TrainRig;
