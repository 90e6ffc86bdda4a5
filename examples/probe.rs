use servotune::diagnose::{bench::Bench, run::runs, scan::Ground, stack::Stack};
use servotune::{recording::*, physics::library, lti::*};
use std::path::Path;
fn main(){
  for a in std::env::args().skip(1){
    let t0=std::time::Instant::now();
    let case=Case::read(Path::new(&a),&RecordSettings::default()).unwrap();
    let pf:PlantFile=servotune::document::read_toml(&case.plant).unwrap();
    let plant=Plant::try_from(pf).unwrap();
    let dt=case.records[0].1.sample_time_s;
    let mut b=Bench::new(&plant,runs(&case),dt,case.spindle_hz).unwrap();
    let all=Stack::single(&b.runs,&b.fit_runs); 
    println!("{} levels {:?}",case.id,b.levels);
    { let f=b.fit(vec![]); let (e,_)=f.screen_basis(&b.p); println!("  given: sse/N {:.3} N {}",e.iter().map(|v|v*v).sum::<f64>()/e.len() as f64,e.len()); }
    let mut ch=vec![];
    let r=b.settle(&mut ch,3).unwrap();
    println!("  levels {:?} t {:.2}",b.levels,t0.elapsed().as_secs_f64());
    println!("  p {:.4?}",&r.p[..4]); println!("  s {:.6?}",&r.spread[..4]); println!("  body {:?} delay {:.3e}",r.plant.body,r.plant.delay_s);
    let f=b.fit(vec![]); let (e,basis)=f.screen_basis(&b.p);
    println!("  refit: cost/N {:.4} projected sse/N {:.4} dim {} conv {}",r.cost/e.len() as f64,e.iter().map(|v|v*v).sum::<f64>()/(e.len()-basis.dimension()) as f64,basis.dimension(),r.converged);
    let plant=b.form.plant(&b.p);
    let g=Ground{fit:&f,plant:&plant,error:&e,basis:&basis};
    let lib=library();
    let mut c=g.scan(lib);
    println!("  scan t {:.2}",t0.elapsed().as_secs_f64());
    for c in c.iter_mut().take(6){ let g0=c.gain; g.refine(c); println!("    {:24} gain {:10.1} ->{:10.1} inner {:.4?} str {:.4?} conc {:.3} {:.3} logp {:.1}",c.effect.facts().name,g0,c.gain,c.setting.inner,c.setting.strengths,c.concealed,c.least_concealed,c.log_p_value(lib.len())); }
    println!("  t {:.2}",t0.elapsed().as_secs_f64()); let _=&all;
  }
}
